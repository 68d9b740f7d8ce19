"""A gantry with a gripper of two fingers, objects to grip, and a loop around them."""

from collections import deque

import numpy as np

from armguard.geometry import Box, Pose
from armguard.respond import Guard
from armguard.scene import Grasp, Gripper, Scene
from gripping.gantry import BELOW, CLOSED, FIGURES, FINGER, HAND, gantry

PERIOD = 0.001

# Half of the sizes of a block to be gripped [m].
BLOCK = (0.02, 0.02, 0.03)


def add_gantry(
    scene, name, *, home=(0.0, 0.0, 0.4), coarse=True, fingers=("left", "right"),
    **options,
):  # fmt: skip
    """A gantry whose gripper is open."""
    x, y, z = home
    scene.add_robot(
        gantry(),
        name=name,
        stopping=FIGURES,
        home={"x": x, "y": y, "z": z, "open_left": 0.04, "open_right": 0.04},
        gripper=Gripper(link="hand", fingers=fingers, coarse=coarse),
        **options,
    )


def add_block(scene, name, xy=(0.0, 0.0), **options):
    """A block that may be gripped, on a table whose top is at z = 0."""
    scene.add(
        Box(size=tuple(2 * half for half in BLOCK)),
        name=name,
        pose=Pose(xyz=(*xy, BLOCK[2])),
        **{"graspable": Grasp(), **options},
    )


def add_table(scene):
    """A table whose top is at z = 0."""
    scene.add(Box(size=(2.0, 2.0, 0.1)), name="table", pose=Pose(xyz=(0, 0, -0.05)))


def pick_scene(*, blocks=None, coarse=True, response="deflect", **settings):
    """A gantry, a table, and blocks on it by name; one in the middle if None."""
    scene = Scene(mode="path", **settings)
    add_gantry(scene, "arm", coarse=coarse, response=response)
    add_table(scene)
    for name, xy in ({"block": (0.0, 0.0)} if blocks is None else blocks).items():
        add_block(scene, name, xy)
    return scene


class Loop:
    """A plant that follows its commands, and what operators do.

    Args:
        guard: The guard.
        delay: Cycles until a command takes effect.
        rng: Draws what velocities miss the commands by; they miss none if None.
        drift: What velocities always miss the commands by, by joint name [m/s]; an arm
            that is held where it is does not drift.
    """

    def __init__(self, guard, delay=1, rng=None, drift=None):
        self.guard = guard
        self.rng = rng
        self.drift = np.array([(drift or {}).get(name, 0.0) for name in guard.q_names])
        self.q = guard.home
        self.v = np.zeros_like(self.q)
        self.t = 0.0
        self.queue = deque([np.zeros_like(self.q)] * delay)
        self.commands, self.rows = [], []

    def cycle(self, desired):
        """One cycle."""
        command = self.guard.filter(self.q, desired, self.t, velocity=self.v)
        self.queue.append(command.velocity)
        self.v = self.queue.popleft()
        if self.rng is not None:
            most = FIGURES["tracking_error"]
            self.v = self.v + self.rng.uniform(-most, most, len(self.v))
        if self.v.any() or command.action == 0:
            self.v = self.v + self.drift
        self.q = self.q + self.v * PERIOD
        self.t += PERIOD
        self.commands.append(command)
        self.rows.append((self.q.copy(), self.v.copy()))
        return command

    def go(self, goal, *, speed=0.2, within=2e-4, longest=20000, gain=8.0):
        """Lead joints by name to positions as an operator does, slower when near.

        Returns:
            Whether they got there.
        """
        names = list(goal)
        places = [self.guard.q_names.index(name) for name in names]
        target = np.array([goal[name] for name in names])
        for _ in range(longest):
            desired = np.zeros_like(self.q)
            way = target - self.q[places]
            if np.abs(way).max() <= within and np.abs(self.v[places]).max() < 1e-3:
                return True
            desired[places] = gain * way
            size = np.linalg.norm(desired)
            if size > speed:
                desired *= speed / size
            self.cycle(desired)
        return False

    def push(self, desired, cycles):
        """Desire the same velocities by joint name; the last command."""
        for _ in range(cycles):
            command = self.cycle(desired)
        return command

    @property
    def stops(self):
        """Commands that were more than to follow."""
        return [c for c in self.commands if c.action > 0]


def guard_of(scene):
    """A guard that does not test itself."""
    return Guard(scene, self_test=False)


def boxes_at(guard, q, held=None, T_held=None):
    """Lower and upper corners of all bodies of gantries and blocks, by hand.

    Args:
        guard: The guard, for names and where free objects stand.
        q: Joint positions, shape (n,), or (k, n) for k cycles: corners are then (k, 3).
        held: Robot that carries each object that is held.
        T_held: Where the object's middle is from the hand's, by object.
    """
    at = dict(zip(guard.q_names, np.asarray(q).T, strict=True))
    found = {"table": (np.array([-1.0, -1.0, -0.1]), np.array([1.0, 1.0, 0.0]))}
    hands = {}
    for part in guard.tables.robots:
        name = part.name
        base = BASES.get(name, np.zeros(3))
        hand = base + np.stack([at[f"{name}/{axis}"] for axis in "xyz"], axis=-1)
        hands[name] = hand
        found[f"{name}/hand"] = (hand - HAND, hand + HAND)
        for finger, side in (("left", 1.0), ("right", -1.0)):
            out = side * (CLOSED + at[f"{name}/open_{finger}"])
            middle = hand + np.stack([0.0 * out, out, 0.0 * out - BELOW], axis=-1)
            found[f"{name}/{finger}"] = (middle - FINGER, middle + FINGER)
    for name, item in guard.tables.holds.objects.items():
        middle = guard.tables.T_parent_joint[item.body][[3, 7, 11]]
        if held and name in held:
            middle = hands[held[name]] + T_held[name]
        found[name] = (middle - BLOCK, middle + BLOCK)
    return found


# Where gantries stand that do not stand in the middle.
BASES: dict[str, np.ndarray] = {}


def gap(a, b):
    """Signed distances of two boxes along the axes, each by its corners [m]."""
    apart = np.maximum(a[0] - b[1], b[0] - a[1])
    most = apart.max(axis=-1)
    return np.where(most > 0.0, np.linalg.norm(np.maximum(apart, 0.0), axis=-1), most)
