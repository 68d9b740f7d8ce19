"""Arms whose plans lead into the space of others, for tests of maps."""

import numpy as np

import armguard as ag
from armguard.maps.cell_plan import CellPlan
from arms import simple_arm
from verifying.oracle import positions

# Declared errors [rad, s].
FOLLOWING, SKEW = 0.01, 0.02

# Where the arms stand [m]; they turn about z, the third one by half a turn at rest.
BASES = {
    "left": (0.0, 0.35, 0.0),
    "right": (0.0, -0.35, 0.0),
    "third": (1.25, 0.0, 0.0),
}


def cell_of(robots=("left", "right"), buffer=0.01):
    """Arms of three capsules each, side by side, at one height."""
    scene = ag.Scene(mode="fixed", buffer=buffer)
    for name in robots:
        turn = np.pi if name == "third" else 0.0
        base = ag.Pose(xyz=BASES[name], rpy=(0.0, 0.0, turn))
        scene.add_robot(simple_arm(joints=2), name=name, base=base)
    return scene


def plan_through(scene, robot, turns, step=1.0, **errors):
    """A plan of one arm: its first joint turns to each of some angles in a second."""
    rows = np.zeros((len(turns), 2))
    rows[:, 0] = turns
    times = step * np.arange(len(turns))
    names = (f"{robot}/joint1", f"{robot}/joint2")
    motion = ag.Trajectory(names, rows, times, f"{robot}.csv")
    return CellPlan(ag.Plan.of(motion, scene, hold_home=True), **errors)


def swings(scene, seed, rows=7, **errors):
    """Plans of both arms that swing into the other's space and out of it."""
    rng = np.random.default_rng(seed)
    found = {}
    for robot, side in (("left", -1.0), ("right", 1.0)):
        turns = rng.uniform(-0.7, -0.2, rows)
        turns[1::2] = rng.uniform(0.4, 0.8, len(turns[1::2]))
        found[robot] = plan_through(scene, robot, side * turns, **errors)
    return found


def worst_rows(world, plans, times, rng, following=FOLLOWING, skew=SKEW):
    """Rows at times of both plans, with every joint and clock off to one side."""
    names, columns = world.scene.q_names, []
    for robot, own in zip(plans, times.T, strict=True):
        tube = plans[robot].plan.tube
        late = own + skew * rng.choice([-1.0, 1.0], len(own))
        rows = positions(tube, np.clip(late, tube.times[0], tube.times[-1]))
        chosen = [name.startswith(f"{robot}/") for name in names]
        columns.append((chosen, rows[:, chosen]))
    found = np.zeros((len(times), len(names)))
    for chosen, rows in columns:
        found[:, chosen] = rows
    return found + following * rng.choice([-1.0, 1.0], found.shape)


def pairs_between(oracle):
    """Which of the oracle's pairs are of two robots."""
    return [a.split("/")[0] != b.split("/")[0] for a, b in oracle.pairs]


def headroom(world, rows):
    """Least distance of links of both robots above their buffer, shape (k,) [m]."""
    own = pairs_between(world.oracle)
    buffers = np.array([world.oracle.buffer(*pair) for pair in world.oracle.pairs])
    return (world.oracle.distances(rows) - buffers)[:, own].min(axis=1)
