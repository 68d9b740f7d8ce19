"""The home of robots in `armguard check`: contacts there, and a free home to paste."""

from collections.abc import Iterator, Mapping, Sequence, Set
from itertools import islice
from typing import Any

from armguard.cli.finding import Finding, Status, in_yaml
from armguard.errors import HomeContactError
from armguard.guard import Level
from armguard.guard.verdict import Verdict
from armguard.respond import Guard
from armguard.scene import compile_scene
from armguard.scene.inseparable import Inseparable, inseparable_links
from armguard.scene.posture import (
    coinciding,
    free_homes,
    robot_of,
    touching_fingers,
)
from armguard.scene.scene import Scene

# Free configurations that are tried with a guard.
TRIES = 3

# Contacts that are listed.
LISTED = 3

Pair = frozenset[str]


def contact_findings(scene: Scene, error: HomeContactError) -> Iterator[Finding]:
    """Contacts at home by their cause, each with the line that ends them.

    Bases at one place come first; then all other contacts of each robot, with a free
    home.
    """
    contacts = depths(error.contacts)
    bases = coinciding(scene, contacts)
    for first, second in bases:
        yield coincidence(scene, first, second)
    together = [{first, second} for first, second in bases]
    rest = {
        pair: depth
        for pair, depth in contacts.items()
        if {robot_of(body) for body in pair} not in together
    }
    robots = {robot_of(body) for pair in rest for body in pair} & scene.robots.keys()
    ignored = {name for pair in bases for name in pair}
    homes = verified_homes(scene, robots, ignored) if robots else {}
    for name in scene.robots:
        own = {
            pair: depth
            for pair, depth in rest.items()
            if name in {robot_of(body) for body in pair}
        }
        if own:
            yield overlap(scene, name, own, homes)


def depths(contacts: Sequence[Any]) -> dict[Pair, float]:
    """Depth of each pair of bodies in contact [m]."""
    found: dict[Pair, float] = {}
    for contact in contacts:
        pair = frozenset((contact.a, contact.b))
        found[pair] = max(found.get(pair, 0.0), -contact.distance)
    return found


def coincidence(scene: Scene, first: str, second: str) -> Finding:
    """Two bases at one place, and a place that is free."""
    tables = compile_scene(scene)
    robot = list(scene.robots).index(first)
    reach = tables.base_reach[tables.robot_of_primitive == robot].max()
    x, y, z = scene.robots[first].base.xyz
    place = [float(x), round(float(y - 1.2 * reach), 1), float(z)]
    return Finding(
        "home",
        "FAIL",
        f"bases of '{first}' and '{second}' coincide",
        "give one a base",
        ("robots", second),
        f"base: {in_yaml({'xyz': place})}",
    )


def settle_pairs(scene: Scene) -> Iterator[Finding]:
    """Pairs of links that no home takes apart, each with the rows that settle it.

    They are closed fingers, and links that are `inseparable_links`. The scene has the
    rows afterwards, so that the check goes on.
    """
    tables = compile_scene(scene)
    fingers = [
        Inseparable(a, b, reason)
        for (a, b), reason in touching_fingers(scene, tables, tables.home).items()
    ]
    known = {(pair.a, pair.b) for pair in fingers}
    links = [x for x in inseparable_links(scene, tables) if (x.a, x.b) not in known]
    touch = [pair for pair in links if pair.buffer is None]
    near = [pair for pair in links if pair.buffer is not None]
    for topic, sentence, remedy, pairs in (
        ("fingers", "closed fingers touch at home", "allow these pairs", fingers),
        ("links", "by construction these are too near", "allow these pairs", touch),
        (
            *("links", "by construction these are nearer than their buffers"),
            *("give them smaller buffers", near),
        ),
    ):
        if pairs:
            yield Finding(
                topic,
                "WARN",
                f"{sentence}: " + ", ".join(f"{pair.a} and {pair.b}" for pair in pairs),
                f"{remedy}; until then the guard does not let the robot move",
                paste="\n".join(rows(pairs)),
                blocks=True,
            )
    for pair in [*fingers, *links]:
        pair.settle(scene)


def rows(pairs: Sequence[Inseparable]) -> list[str]:
    """Rows of a scene file that settle pairs, all in one way."""
    if pairs[0].buffer is None:
        found = [{"a": x.a, "b": x.b, "reason": x.reason} for x in pairs]
        return ["allow:", *(f"  - {in_yaml(row)}" for row in found)]
    return [
        "buffers:",
        *(
            f"  - {in_yaml({'a': x.a, 'b': x.b, 'buffer': x.buffer})}  # {x.reason}"
            for x in pairs
        ),
    ]


def overlap(
    scene: Scene,
    name: str,
    contacts: Mapping[Pair, float],
    homes: Mapping[str, Mapping[str, float]],
) -> Finding:
    """Contacts of a robot at home, and a free home."""
    robot = scene.robots[name]
    listed = [
        " and ".join(sorted(body.removeprefix(f"{name}/") for body in pair))
        + f" by {depth * 1e3:.1f} mm"
        + doubt(scene, pair, depth)
        for pair, depth in sorted(contacts.items(), key=lambda item: -item[1])[:LISTED]
    ]
    more = len(contacts) - len(listed)
    sentence = "at home these overlap: " + ", ".join(listed)
    sentence += f" and {more} more" if more else ""
    if not robot.model.group_states:
        sentence += (
            "; without an SRDF home is that of a recognised arm, or the pose nearest "
            "to zero"
        )
    if name in homes:
        remedy = "this posture is free"
        return Finding(
            "home", "FAIL", sentence, remedy, ("robots", name), line(homes[name])
        )
    deepest: Pair = max(contacts, key=contacts.__getitem__)
    a, b = sorted(deepest)
    return Finding(
        "home",
        "FAIL",
        sentence,
        "no free posture was found: move the base or the object, or allow an intended "
        f"contact with `allow: [{in_yaml({'a': a, 'b': b, 'reason': 'WHY'})}]`",
        ("robots", name),
    )


def doubt(scene: Scene, pair: Pair, depth: float) -> str:
    """That bodies may be apart, if their shapes overestimate them more than this."""
    excess = sum(overestimate(scene, body) for body in pair)
    if excess < depth or excess == 0.0:
        return ""
    beyond = f"their shapes reach up to {excess * 1e3:.1f} mm beyond them"
    return f" ({beyond}: they may be apart)"


def overestimate(scene: Scene, body: str) -> float:
    """How far the closest shapes of a link or object reach beyond its geometry [m]."""
    robot, _, link = body.partition("/")
    if not link:
        return max(s.model_error for s in scene.objects[body].shapes)
    fit = scene.robots[robot].fits[link]
    return max(s.model_error for s in fit.exact or fit.shapes)


def close_findings(scene: Scene, verdict: Verdict) -> Iterator[Finding]:
    """A home at which a pair is nearer than it must be, and a free home."""
    homes = verified_homes(scene, set(scene.robots))
    if not homes:
        remedy = "move a base or an object, so that home has room"
        yield Finding("home", "FAIL", verdict.why, remedy)
    for name, home in homes.items():
        yield Finding(
            "home",
            "FAIL",
            verdict.why,
            "this posture is free",
            ("robots", name),
            line(home),
        )


def line(home: Mapping[str, float]) -> str:
    """A home as a line of the scene file."""
    return f"home: {in_yaml(dict(home))}"


def verified_homes(
    scene: Scene, robots: Set[str], ignored: Set[str] = frozenset()
) -> dict[str, dict[str, float]]:
    """A home of robots that a guard accepts, by robot and joint; none if none is found.

    Args:
        scene: The scene; unchanged afterwards.
        robots: Robots that may have another home.
        ignored: Robots whose contacts with each other do not count.
    """
    before = {name: dict(scene.robots[name].home) for name in robots}
    found = islice(free_homes(scene, compile_scene(scene), robots, ignored), TRIES)
    try:
        for homes in found:
            for name, home in homes.items():
                scene.set_home(name, home)
            if is_free(scene, ignored):
                return homes
    finally:
        for name, home in before.items():
            scene.set_home(name, home)
    return {}


def is_free(scene: Scene, ignored: Set[str]) -> bool:
    """Whether a guard accepts the home of all robots."""
    try:
        guard = Guard(scene, self_test=False)
    except HomeContactError as error:
        return bool(ignored) and all(
            {robot_of(body) for body in pair} <= ignored
            for pair in depths(error.contacts)
        )
    return guard.home_verdict.level is not Level.STOP


def roomier(scene: Scene, sentence: str, status: Status) -> Iterator[Finding]:
    """A self-test that failed or lacks room around home, and a home with more."""
    homes = verified_homes(scene, set(scene.robots))
    remedy = "a home with more room lets the test run"
    if all(scene.robots[name].home == home for name, home in homes.items()):
        homes, remedy = {}, "move bases and objects apart, so that home has room"
        yield Finding("self-test", status, sentence, remedy)
    for name, home in homes.items():
        keys = ("robots", name)
        yield Finding("self-test", status, sentence, remedy, keys, line(home))
