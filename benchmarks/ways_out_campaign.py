"""From every stopped state at the limit there is a way out, or the pinch is named.

make ways-out                          10,000 states of the bay, 2,000 of two Pandas
make ways-out ARGS="--states 500"      some of them

States lie on straight lines between random configurations, where the nearest pair is
about as near as it may be: up to 4 mm nearer, or up to 2 mm farther. The arms rest
there. Requested are the way out that the cues show, and then each joint alone, both
ways. A way counts as out if what is commanded moves, no pair that was too near comes
nearer by it, and one of them, if there is any, comes to be farther; that is measured
anew, at rest. Where none is commanded, `PINCHED` has to be, and the pinch is looked for
in the same independent way: every joint, both ways, brings some pair nearer that is too
near.
"""

import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np

from armguard.cli.console import say
from armguard.respond import Blocked, Guard
from armguard.scene import Scene, bay_scene
from arrays import Floats
from closed_loop.scenes import build_scene
from closed_loop.settings import setting_of
from episodes.campaign import command
from episodes.follower import Arms
from episodes.records import keep
from pages import DOCS

RESULTS = DOCS / "ways_out.json"

# How much nearer, or less near, than its buffer the nearest pair is [m].
NEARER, FARTHER = 0.004, 0.002

# Samples of a line on which the limit is looked for, and halvings after that.
SAMPLES, HALVINGS = 40, 30

# Cycles in which an arm is seen to rest, and in which a way is requested.
REST, ASK = 8, 3

# Share of the top speeds that is requested [-].
SPEED = 0.1

# Motion by which it is seen whether a way leads out [rad], and what no way may bring a
# pair nearer by on it, which is what it bends [m].
STEP = 1e-3
GRAIN = 2e-6


@dataclass
class Count:
    """Counts of states."""

    states: int = 0
    too_near: int = 0
    out_by_cue: int = 0
    out_by_joint: int = 0
    pinched: int = 0
    pinched_in_truth: int = 0
    neither: int = 0


def states(guard: Guard, rng: np.random.Generator) -> Iterator[Floats]:
    """Configurations in which the nearest pair is about as near as it may be."""
    arms = Arms(guard.tables)
    while True:
        wanted = rng.uniform(-NEARER, FARTHER)
        a, b = rng.uniform(arms.lower, arms.upper, (2, len(arms.lower)))
        if least(guard, a) < wanted:
            continue
        shares = np.linspace(0.0, 1.0, SAMPLES)
        hit = next((s for s in shares if least(guard, a + s * (b - a)) < wanted), None)
        if hit is None:
            continue
        far, near = hit - shares[1], hit
        for _ in range(HALVINGS):
            middle = 0.5 * (far + near)
            if least(guard, a + middle * (b - a)) < wanted:
                near = middle
            else:
                far = middle
        yield a + far * (b - a)


def least(guard: Guard, q: Floats) -> float:
    """Least headroom at rest, as far as it is known [m]."""
    nearest = guard.judge_at_rest(q).nearest
    return np.inf if nearest is None else nearest.headroom


def headroom(guard: Guard, q: Floats) -> dict[tuple[str, str], float]:
    """Headroom at rest of each near pair [m]."""
    return {
        (pair.primitive_a, pair.primitive_b): pair.headroom
        for pair in guard.judge_at_rest(q).near
    }


def commanded(
    guard: Guard, q: Floats, desired: Floats
) -> tuple[Floats, tuple[Blocked, ...]]:
    """Commands to arms that rest at q and are asked to move."""
    guard.reset()
    still = np.zeros_like(q)
    time = 0.0
    for k in range(REST + ASK):
        asked = still if k < REST else desired
        command = guard.filter(q, asked, time, velocity=still, now=time)
        time += guard.tables.period
    return command.velocity, tuple(command.blocked.values())


def changes(guard: Guard, q: Floats, way: Floats) -> list[float]:
    """Changes of the headroom of pairs that are too near by a motion [m]."""
    before, after = headroom(guard, q), headroom(guard, q + STEP * way)
    return [after.get(p, np.inf) - c for p, c in before.items() if c < 0.0]


def leads_out(guard: Guard, q: Floats, velocity: Floats) -> bool:
    """Whether a motion opens what is too near, and brings nothing of it nearer."""
    size = float(np.abs(velocity).max())
    if size < 1e-9:
        return False
    found = changes(guard, q, velocity / size)
    return not found or (min(found) >= -GRAIN and max(found) > GRAIN)


def judge(guard: Guard, q: Floats, count: Count) -> None:
    """Look for a way out of a state."""
    count.states += 1
    top = Arms(guard.tables).joined("velocity")
    before = headroom(guard, q)
    count.too_near += any(c < 0.0 for c in before.values())
    guard.reset()
    still = np.zeros_like(q)
    cues = guard.step(q, 0.0, velocity=still, now=0.0).cues
    desired = SPEED * top * np.concatenate([cue.escape for cue in cues.values()])
    velocity, blocked = commanded(guard, q, desired)
    if leads_out(guard, q, velocity):
        count.out_by_cue += 1
        return
    for way in ways(len(q)):
        velocity, _ = commanded(guard, q, SPEED * top * way)
        if leads_out(guard, q, velocity):
            count.out_by_joint += 1
            return
    if Blocked.PINCHED in blocked:
        count.pinched += 1
        count.pinched_in_truth += is_pinched(guard, q)
    else:
        count.neither += 1


def ways(n: int) -> Iterator[Floats]:
    """Each joint alone, both ways, shape (n,)."""
    yield from (sign * row for row in np.eye(n) for sign in (1.0, -1.0))


def is_pinched(guard: Guard, q: Floats) -> bool:
    """Whether every joint, both ways, brings nearer what is too near."""
    return not any(
        max(np.abs(changes(guard, q, way)), default=0.0) > GRAIN
        and leads_out(guard, q, way)
        for way in ways(len(q))
    )


def run(scene: Scene, number: int, seed: int = 0) -> Count:
    """Look for ways out of some states of a scene."""
    guard = Guard(scene, self_test=False)
    found = Count()
    for q in states(guard, np.random.default_rng(seed)):
        judge(guard, q, found)
        if found.states == number:
            return found
    return found


def main() -> int:
    """Run; write docs/ways_out.json; 1 if a state had neither way nor pinch."""
    parser = command(__doc__)
    parser.add_argument("--states", type=int, default=10_000)
    chosen = parser.parse_args()
    scenes = {
        "bay": (bay_scene("path"), chosen.states),
        "pandas": (build_scene(setting_of("pandas", "path", 0)), chosen.states // 5),
    }
    broken = False
    for name, (scene, number) in scenes.items():
        say(f"{name}: {number} states")
        found = asdict(run(scene, number))
        print(name, found)
        keep(RESULTS, name, found, number)
        broken |= found["neither"] > 0
    return int(broken)


if __name__ == "__main__":
    sys.exit(main())
