"""The plays: every mode, response and call, objects that come and go, faults."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from armguard.geometry import Box, Capsule, Pose, Sphere
from armguard.respond import Guard
from armguard.scene import Scene, bay_scene, two_pandas_scene
from armguard.scene.settings import IndexSettings, ResponseSettings
from golden.drive import Drive, Input, Play
from golden.gripping import GRIPPING
from golden.wire import WIRE
from speed.scenes import bay_among_boxes

Change = Callable[[Drive], None]

# Objects with the fastest and the usual declared speed [m/s].
FAST, SLOW = 1.0, 0.2


def bay(
    mode: Any = "path",
    response: str | ResponseSettings = "deflect",
    **more: Any,
) -> Callable[[], Scene]:
    """Makes the bay, with a ball that may come and a cart that moves.

    Args:
        mode: Of both arms.
        response: Of both arms.
        more: Attributes of the scene.
    """

    def make() -> Scene:
        scene = bay_scene(mode)
        scene.set_response(response)
        scene.set_stale(0.012)
        scene.add(Sphere(radius=0.05), name="ball", present=False, top_speed=FAST)
        scene.add(Box(size=(0.12, 0.1, 0.08)), name="crate", present=False)
        scene.add(
            Capsule(start=(0, 0, -0.1), end=(0, 0, 0.1), radius=0.04),
            name="cart",
            present=False,
            top_speed=SLOW,
        )
        for name, value in more.items():
            setattr(scene, name, value)
        return scene

    return make


def pandas(
    mode: Any = "path", response: str | ResponseSettings = "deflect"
) -> Callable[[], Scene]:
    """Makes the two Pandas."""

    def make() -> Scene:
        scene = two_pandas_scene()
        scene.set_mode(mode)
        scene.set_response(response)
        scene.set_stale(0.012)
        return scene

    return make


def million() -> Scene:
    """The bay among a million boxes."""
    scene = bay_among_boxes(1_000_000)
    scene.set_mode("path")
    scene.set_stale(0.012)
    return scene


def at(changes: Mapping[int, Change]) -> Change:
    """Changes by the cycle before which they happen."""

    def happen(drive: Drive) -> None:
        if drive.k in changes:
            changes[drive.k](drive)

    return happen


def objects_move(drive: Drive) -> None:
    """Two objects come, move, take other shapes and go, sometimes in an arm's way."""
    guard, k = drive.guard, drive.k
    if k % 700 == 0:
        guard.remove("cart")
    elif k % 2:
        x = 0.25 - 0.0008 * (k % 700)
        velocity = (-0.0004 / drive.play.period, 0.0, 0.0)
        guard.place("cart", Pose(xyz=(x, 0.1, 1.0)), drive.time, velocity=velocity)
    if k % 90 == 10:
        place = drive.rng.uniform((-0.3, -0.3, 0.8), (0.3, 0.3, 1.3))
        size = float(drive.rng.uniform(0.03, 0.08))
        guard.place(
            "crate", Pose(xyz=tuple(place)), shape=Box(size=(2 * size, 0.1, 0.08))
        )
    if k % 90 == 60:
        guard.remove("crate")


def ball_comes(drive: Drive) -> None:
    """A ball flies at the left arm, again and again."""
    k = drive.k % 250
    if k == 200:
        drive.guard.remove("ball")
    elif 20 <= k < 200:
        x = 0.8 - 0.002 * (k - 20)
        velocity = (-0.002 / drive.play.period, 0.0, 0.0)
        pose = Pose(xyz=(x, 0.35, 0.9))
        drive.guard.place("ball", pose, drive.time, velocity=velocity)


def too_near(drive: Drive) -> None:
    """An object appears nearer to an arm than it may be, and stays for a while."""
    k = drive.k % 200
    if k == 100:
        link = drive.guard.poses.reshape(-1, 3, 4)[5, :, 3]
        xyz = tuple(link + np.array([0.0, 0.0, 0.16]))
        drive.guard.place("crate", Pose(xyz=xyz))
    if k == 180:
        drive.guard.remove("crate")


def too_near_mover() -> Change:
    """An object that moves by itself appears too near to an arm, and passes slowly."""
    place = np.zeros(3)

    def happen(drive: Drive) -> None:
        k = drive.k % 200
        if k == 100:
            link = drive.guard.poses.reshape(-1, 3, 4)[5, :, 3]
            place[:] = link + np.array([0.0, 0.0, 0.16])
        if 100 <= k < 180:
            place[0] += 0.0002
            drive.guard.place("cart", Pose(xyz=tuple(place)), drive.time)
        if k == 180:
            drive.guard.remove("cart")

    return happen


def goals(drive: Drive) -> None:
    """Goals for both arms, in joints and for a tool."""
    if drive.k % 300 == 1:
        for name in drive.tools:
            goal = drive.guard.home[:7] + drive.rng.uniform(-0.6, 0.6, 7)
            drive.guard.field_goal(name, q=goal)
    if drive.k % 300 == 200:
        drive.guard.field_goal(drive.tools[0])
    drive.aim = drive.q.copy()


def stops_and_retreats(drive: Drive) -> None:
    """Stops that are ordered, and ways back."""
    k = drive.k % 300
    if k == 120:
        command = drive.guard.stop(drive.q, drive.time - 5e-4, velocity=drive.v)
        drive.v = np.array(command.velocity)
    if k == 180:
        drive.guard.retreat(drive.tools[0])
    if k == 260:
        drive.guard.engage(drive.tools[0])
    if k == 299:
        drive.guard.reset()


def another_goes_on(drive: Drive) -> None:
    """Another guard takes the place of the first one, from its checkpoint."""
    if drive.k % 77 == 0:
        scene = drive.play.scene()
        scene.period = drive.play.period
        other = Guard(scene, self_test=False)
        other.restore(drive.guard.checkpoint())
        drive.guard = other


def spoilt(drive: Drive, given: Input) -> None:
    """One cycle in thirty is given something that cannot be true."""
    if drive.k % 30:
        return
    kind, q, v = drive.k // 30 % 16, given.q.copy(), given.velocity.copy()
    if kind == 0:
        q[3] = np.nan
    elif kind == 1:
        q = q[:-1]
    elif kind == 2:
        q[2] = np.inf
    elif kind == 3:
        q[8] += 0.4
    elif kind == 4:
        q[1] = 40.0
    elif kind == 5:
        v[5] = np.nan
    elif kind == 6:
        v[0] = 30.0
    elif kind == 7:
        given.stamp = drive.time - 1.0
    elif kind == 8:
        given.stamp = drive.time + 1.0
    elif kind == 9:
        given.stamp = np.nan
    elif kind == 10:
        given.now = drive.time - 2.0 * drive.play.period
    elif kind == 11:
        given.now = np.inf
    elif kind == 12:
        given.desired = np.full_like(q, np.nan)
    elif kind == 13:
        given.desired = given.desired[:3]
    elif kind == 14:
        given.stamp = {drive.tools[0]: given.stamp}
    elif kind == 15:
        drive.k += 40
    given.q, given.velocity = q, v


def hangs(drive: Drive, given: Input) -> None:
    """Positions hang, then velocities, now and then."""
    k = drive.k % 150
    if 60 <= k < 100:
        given.q = drive.guard.home
    if 120 <= k < 140:
        given.velocity = np.zeros_like(given.velocity)


EVADING = ResponseSettings(kind="deflect", evade=True)
EQUAL = ResponseSettings(kind="deflect", sharing="equal")
FIRST = ResponseSettings(kind="deflect", sharing="priority", priority=1.0)

PLAYS = (
    Play("bay step fixed", bay("fixed"), form="step"),
    Play("bay step speed", bay("speed"), form="step"),
    Play("bay step path", bay("path"), form="step", events=objects_move),
    Play("bay step estimated", bay("path"), form="step", velocities=False),
    Play("bay step no clock", bay("path"), form="step", clocked=False),
    Play("bay step spoilt", bay("path"), form="step", faults=spoilt),
    Play("pandas step fixed", pandas("fixed"), form="step"),
    Play("pandas step path", pandas("path"), form="step", reach=2.0),
    Play("bay stop", bay(response="stop")),
    Play("bay slow", bay(response="slow")),
    Play("bay deflect", bay(), cycles=1200),
    Play("bay deflect speed", bay("speed")),
    Play("bay deflect 1 kHz", bay(), period=0.001, cycles=2000),
    Play("bay deflect slowly", bay(), period=0.02, speed=0.3),
    Play("bay field", bay(response="field"), events=goals),
    Play("bay equal", bay(response=EQUAL)),
    Play("bay priority", bay(response=FIRST)),
    Play("bay positions", bay(), form="positions", cycles=900),
    Play("bay twists", bay(), form="twists", seed=1, cycles=900),
    Play("bay estimated", bay(), velocities=False),
    Play("bay no clock", bay(), clocked=False),
    Play("bay objects", bay(), events=objects_move, cycles=900),
    Play("bay too near", bay(), events=too_near, cycles=900),
    Play("bay too near a mover", bay(), events=too_near_mover(), cycles=900),
    Play("bay evading", bay(response=EVADING), events=ball_comes, speed=0.1),
    Play("bay retreat", bay(), events=stops_and_retreats, cycles=900),
    Play("bay checkpoints", bay(), events=another_goes_on, cycles=400),
    Play("bay brute force", bay(index=IndexSettings(kind="brute_force"))),
    Play("bay spoilt", bay(), faults=spoilt, cycles=1000),
    Play("bay hangs", bay(), faults=hangs, speed=0.4),
    Play("bay a million", million, cycles=200),
    Play("pandas stop", pandas(response="stop"), cycles=400, reach=2.0),
    Play("pandas slow", pandas(response="slow"), cycles=400, reach=2.0),
    Play("pandas deflect", pandas(), cycles=800, reach=2.0),
    Play("pandas twists", pandas(), form="twists", cycles=600),
    *GRIPPING,
    *WIRE,
)
