"""Unknown planar worlds: an arm follows sensed surfaces to its goal, or reports none.

make following                                                  100 worlds of each arm
make following ARGS="--kind 'two links' --first 3 --episodes 1 --show"    one of them
make following ARGS=--page                                      page and plot anew

It resumes: worlds that were run with the same code are known from docs/following.json.
A way exists, or none does, by a search on a grid of the joint torus. Zones with noise
see the polygons; distances of segments judge the true way. A guard of the whole world
filters each command.
"""

import ast
import sys
from collections.abc import Mapping
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.patches import Polygon
from numpy.typing import NDArray

import planar_worlds
from armguard.geometry import Hull, Pose
from armguard.respond import Action, Guard
from armguard.respond.following import PlanarFollower, State, arm, curve, planar
from armguard.respond.following.arm import to_segments, unit_vectors
from armguard.respond.following.curve import Curve
from armguard.scene import Scene
from episodes.campaign import Campaign, Episode
from episodes.records import Digest, Figures
from pages import DOCS
from planar_worlds import (
    ARMS,
    STANDOFF,
    World,
    distances,
    links_of,
    planar_robot,
    sensed,
    world,
)
from plots import drawn

Floats = NDArray[np.float64]

# Steps after which a follower counts as one that loops.
MOST = 30_000

# Standoff that counts as kept while a surface is followed [m].
LEAST, GREATEST = 0.08, 0.17

# Time of a step, so that a joint moves at 0.5 rad/s, and period of the guard [s].
SECONDS, PERIOD = 0.04, 0.01

KINDS = {
    **{name: (name, True) for name in ARMS},
    **{f"{name}, no way": (name, False) for name in ARMS},
}

# Distances of the surface of the arm that are drawn as the standoff, and what part of
# the plane is drawn [m].
BAND, VIEW = (0.1, 0.15), (-1.4, 1.4)

BEGIN, END = "<!-- campaign -->\n", "<!-- end of campaign -->"


class Run(NamedTuple):
    """A way through a world.

    Attributes:
        state: How it ended.
        path: Joint positions, shape (k, n) [rad or m].
        held: At which of these the standoff decided the motion, shape (k,).
        changed: Cycles in which the guard stopped the arm or changed its command.
        cycles: Its cycles.
        curves: Boundaries in joint space that were followed wholly.
    """

    state: State
    path: Floats
    held: NDArray[np.bool_]
    changed: int
    cycles: int
    curves: list[Curve]


def guard_of(name: str, one: World) -> Guard:
    """A guard that knows the whole world."""
    scene = Scene(mode="path", period=PERIOD, buffer=0.005)
    home = {f"joint{k}": float(x) for k, x in enumerate(one.start)}
    scene.add_robot(
        planar_robot(ARMS[name]), "arm", home=home, response="slow",
        stopping={
            "velocity": 1.0, "acceleration": 200.0, "deceleration": 5.0,
            "position_error": 1e-4, "velocity_error": 1e-3, "tracking_error": 1e-3,
        },
    )  # fmt: skip
    if ARMS[name].travel:
        scene.allow("arm/link0", "arm/link2", reason="its links are above each other")
    for k, part in enumerate(one.parts):
        corners = [(x, y, z) for x, y in part.tolist() for z in (-0.2, 0.2)]
        scene.add(Hull(points=corners), f"part{k}", pose=Pose())
    return Guard(scene, self_test=False)


def run(name: str, one: World, seed: int, guard: Guard | None) -> Run:
    """Lead the arm through a world.

    Args:
        name: Name of the arm.
        one: The world.
        seed: Seed of the noise.
        guard: Filters the commands; None without one.
    """
    body, rng, edges = ARMS[name], np.random.default_rng(seed), one.edges
    follower = PlanarFollower(body, one.start, one.goal, standoff=STANDOFF)
    q, path, held = one.start.copy(), [one.start.copy()], [False]
    changed, cycles, moving = 0, 0, np.zeros_like(q)
    if guard is not None:
        # From the first cycle on it knows that the arm is at rest.
        guard.filter(q, moving, 0.0, velocity=moving)
    while follower.state in (State.TO_GOAL, State.FOLLOWING) and len(path) < MOST:
        target = follower.step(q, sensed(body, q, edges, rng))
        held[-1] = follower.held
        v = (target - q) / SECONDS
        for _ in range(round(SECONDS / PERIOD) if guard is not None else 0):
            cycles += 1
            command = guard.filter(q, v, cycles * PERIOD, velocity=moving)
            moving = command.velocity.copy()
            same = np.allclose(moving, v, atol=1e-9)
            changed += not same or command.action != Action.FOLLOW
            q = q + PERIOD * moving
        if guard is None:
            q = target
        path.append(q.copy())
        held.append(False)
    return Run(
        follower.state, np.array(path), np.array(held), changed, cycles, follower.curves
    )  # fmt: skip


def episode(kind: str, seed: int) -> Episode:
    """One world: how it ended, and the true distances on the way."""
    name, reachable = KINDS[kind]
    one = world(name, seed, reachable)
    found = run(name, one, seed, guard_of(name, one))
    between = 0.5 * (found.path[1:] + found.path[:-1])
    true = distances(ARMS[name], found.path, one.parts)
    least = min(true.min(), distances(ARMS[name], between, one.parts).min())
    at = true[found.held]
    off = (found.path[-1] - one.goal + np.pi) % (2.0 * np.pi) - np.pi
    expected = State.ARRIVED if reachable else State.UNREACHABLE
    return {
        "seed": seed,
        "state": found.state.name,
        "right": found.state == expected
        and (not reachable or float(np.abs(off).max()) < 1e-3),
        "looped": len(found.path) >= MOST,
        "steps": len(found.path),
        "least_mm": 1e3 * float(least),
        "contact": bool(least <= 0.0),
        "held": int(found.held.sum()),
        "kept": int(((at >= LEAST) & (at <= GREATEST)).sum()),
        "nearest_mm": 1e3 * float(at.min(initial=STANDOFF)),
        "farthest_mm": 1e3 * float(at.max(initial=STANDOFF)),
        "cycles": found.cycles,
        "changed": found.changed,
    }


def summed_up(_: str, episodes: list[Episode]) -> Figures:
    """Figures of worlds, all of which but extremes are sums."""
    names = ("right", "looped", "contact", "steps", "held", "kept", "cycles", "changed")
    return {
        "episodes": len(episodes),
        **{name: sum(e[name] for e in episodes) for name in names},
        "undecided": sum(e["state"] == "UNDECIDED" for e in episodes),
        "least_mm": min(e["least_mm"] for e in episodes),
        "nearest_mm": min(e["nearest_mm"] for e in episodes),
        "farthest_mm": max(e["farthest_mm"] for e in episodes),
    }


@cache
def version(kind: str) -> str:
    """Hash of the code of follower and worlds; comments do not count."""
    whole = sha256(kind.encode())
    for module in (arm, curve, planar, planar_worlds):
        text = Path(str(module.__file__)).read_text(encoding="utf-8")
        whole.update(ast.dump(ast.parse(text)).encode())
    return whole.hexdigest()[:16]


def page(results: Mapping[str, Figures]) -> str:
    """The page, with a table of what is known; the plot is drawn beside it."""
    rows = [
        "| worlds | number | goal reached, or named unreachable | looped or undecided "
        "| contacts, least distance [mm] | steps along surfaces "
        "| at 100 to 150 mm ± 20 | nearest, farthest [mm] | cycles of the guard "
        "| changed by it |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for kind, f in results.items():
        rows.append(
            f"| {kind} | {f['episodes']} "
            f"| {f['right']} ({f['right'] / f['episodes']:.1%}) "
            f"| {f['looped'] + f['undecided']} | {f['contact']}, {f['least_mm']:.0f} "
            f"| {f['held']} | {f['kept'] / max(f['held'], 1):.2%} "
            f"| {f['nearest_mm']:.0f}, {f['farthest_mm']:.0f} | {f['cycles']} "
            f"| {f['changed']} |"
        )
    draw(DOCS / "images" / "following.png")
    text = (DOCS / "following.md").read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    table = "\n".join((*rows, ""))
    return f"{before}{BEGIN}{table}{END}{rest.partition(END)[2]}"


def draw(path: Path) -> None:
    """Draw six worlds: polygons with the standoff, ways of the tip, and arms."""
    chosen = [(name, seed, True) for name in ARMS for seed in (1, 2)]
    chosen += [(name, 1, False) for name in ARMS]
    with drawn(path, (11, 8.8), 3, 2) as places:
        order = (0, 1, 4, 2, 3, 5)
        for axes, (name, seed, reachable) in zip(
            places, [chosen[k] for k in order], strict=True
        ):
            one = world(name, seed, reachable)
            found = run(name, one, seed, None)
            draw_obstacles(axes, one)
            tips = links_of(ARMS[name], found.path)[:, 1, 1]
            axes.plot(*tips.T, color="C0", linewidth=0.8)
            axes.plot(*np.where(found.held[:, None], tips, np.nan).T, color="C1")
            draw_arm(axes, name, one.start, {"color": "C2", "alpha": 0.5})
            draw_arm(axes, name, found.path[-1], {"color": "C0", "alpha": 0.5})
            style = {"fill": False, "edgecolor": "C3", "linestyle": ":"}
            draw_arm(axes, name, one.goal, style)
            axes.set_title(f"{name}: {ending(found)}", fontsize=9)
            axes.set(aspect="equal", xlim=VIEW, ylim=VIEW)
            axes.set_xlabel("x [m]", fontsize=8)
            axes.set_ylabel("y [m]", fontsize=8)
            axes.tick_params(labelsize=7)


def ending(found: Run) -> str:
    """The state at the end; of an unreachable goal the boundaries that divide it."""
    lines = []
    for one in found.curves if found.state == State.UNREACHABLE else ():
        low, high = np.degrees([one.points.min(axis=0), one.points.max(axis=0)])
        if not one.closed:
            lines.append("boundaries around the joint torus divide them")
        elif one.around_arm:
            lines.append(f"joint 1 stays between {low[0]:.0f}° and {high[0]:.0f}°,")
            lines.append(f"joint 2 between {low[1]:.0f}° and {high[1]:.0f}°")
        else:
            lines.append("a boundary in joint space encloses the goal")
    return "\n".join((found.state.name, *dict.fromkeys(lines)))


def draw_obstacles(axes: Any, one: World) -> None:
    """Draw polygons, and where the distance to them is that of the standoff."""
    line = np.linspace(*VIEW, 281)
    x, y = np.meshgrid(line, line)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    far = to_segments(points, one.edges[:, 0], one.edges[:, 1]).min(axis=0)
    axes.contourf(line, line, far.reshape(x.shape), BAND, colors=["#f6dfb8"])
    for part in one.parts:
        axes.add_patch(Polygon(part, color="0.6"))


def draw_arm(axes: Any, name: str, q: Floats, style: Mapping[str, Any]) -> None:
    """Draw the capsules of an arm."""
    for a, b in links_of(ARMS[name], q):
        turn = np.arctan2(*(b - a)[::-1]) + np.linspace(-0.5, 0.5, 30) * np.pi
        rim = ARMS[name].radius * unit_vectors(turn)
        axes.add_patch(Polygon(np.concatenate([b + rim, a - rim]), **style))


CAMPAIGN = Campaign(
    results=DOCS / "following.json",
    kinds={kind: partial(episode, kind) for kind in KINDS},
    version=version,
    extreme={"least_mm": min, "nearest_mm": min, "farthest_mm": max},
    summed_up=summed_up,
    digest=lambda e: Digest(
        e["seed"], "" if e["right"] else e["state"], e["least_mm"],
        {"steps": e["steps"], "changed": e["changed"]},
    ),
    is_broken=lambda f: f["contact"] + f["looped"] > 0,
    is_notable=lambda e: not e["right"] or e["contact"] or e["changed"] > 0,
    count=100,
    shares={f"{name}, no way": 0.25 for name in ARMS},
    written=25,
    page=page,
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
