"""An arm that drives at a fixture while hostile clients try to take it away.

MuJoCo judges. It has all fixtures where the scene has them.
"""

import itertools
import tempfile
import time
from contextlib import ExitStack
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from armguard.scene import load_scene
from armguard.scene.compile import compile_scene
from attack.raw import Kind, Raw, Role
from attack.row import Row
from attack.service import AWAY, GUESSES, fixed
from attack.target import LATE, Arms, Target, patient_bay
from closed_loop.judge import Judge

# What is driven into which fixture, by which joint, and how fast [rad/s].
FIXTURE, LINK, JOINT, SPEED = "bench", "left/link7", 1, 0.3

# How much nearer to it the drives begin than home is [rad].
NEARER = 1.1

# How far it is driven from there: into the fixture [rad].
BEYOND = 0.6

# A stop before it has moved so far is the busy machine's: it is engaged again [rad].
UNDERWAY = 0.15

# Longest drive one way [s].
LONGEST = 30.0

# An arm that is no farther from the fixture has been at it, and beyond that nothing is
# measured [m].
AT_IT, FAR = 0.15, 0.5

# Of so many positions one is judged; the arm moves by a few millimetres meanwhile.
EACH = 4

# Pause between two messages of a hostile client [s].
PAUSE = 0.001


class Driver:
    """Drives an arm at a fixture and back, again and again.

    Args:
        arms: The arms.
    """

    def __init__(self, arms: Arms) -> None:
        self.arms = arms
        self._home, self._way = arms.q[JOINT], 0.0
        arms.desired = self._desired

    def drive(self) -> bool:
        """Drive until the arm is stopped, then back; whether it did both in time."""
        self.arms.engages, self._way = True, 0.0
        self.arms.wait_until(lambda answer: not any(answer.actions), LONGEST)
        self._way = 1.0
        self.arms.wait_until(lambda _: self._moved > UNDERWAY, LONGEST)
        self.arms.engages = False
        stopped = self.arms.wait_until(lambda _: self.rests, LONGEST)
        self.arms.engages, self._way = True, -1.0
        back = self.arms.wait_until(lambda _: self._moved <= 0.0, LONGEST)
        self._way = 0.0
        return stopped and back

    @property
    def rests(self) -> bool:
        """Whether the arm was stopped and rests, or is where it was driven to."""
        arms = self.arms
        stopped = arms.newest is not None and any(arms.newest.actions)
        return (stopped and not any(arms.v)) or self._moved > BEYOND

    @property
    def _moved(self) -> float:
        """How far the joint is from where it began [rad]."""
        return self.arms.q[JOINT] - self._home

    def _desired(self, t: float) -> list[float]:
        found = [0.0] * len(self.arms.q)
        found[JOINT] = self._way * SPEED
        return found


def hostile(port: int, keys: dict[int, bytes], names: list[str], sent: Any) -> None:
    """Remove all fixtures again and again, with all keys that may not and with none."""
    with ExitStack() as stack:
        crowd = []
        for role in (Role.OBSERVE, Role.SENSE, Role.COMMAND):
            one = stack.enter_context(Raw(port, keys[role], role))
            one.connect()
            crowd.append(one)
        for key in GUESSES:
            stranger = stack.enter_context(Raw(port, key))
            stranger.session, stranger.scene = one.session, one.scene
            crowd.append(stranger)
        for name, raw in itertools.cycle(itertools.product(names, crowd)):
            raw.say(Kind.CALL, raw.calling("remove", name=name))
            raw.say(Kind.CALL, raw.calling("place", name=name, pose=AWAY))
            sent.value += 2
            time.sleep(PAUSE)


def run(drives: int) -> list[Row]:
    """Drive at a fixture beside hostile clients.

    Args:
        drives: How often.
    """
    context = get_context("fork")
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        target = stack.enter_context(Target(folder, "--response", "stop"))
        scene = load_scene(patient_bay(folder, LATE))
        judge = Judge(scene, compile_scene(scene))
        sent = context.Value("q", 0)
        words = (target.port, target.keys, fixed(), sent)
        enemy = context.Process(target=hostile, args=words, daemon=True)
        enemy.start()
        raw = target.raw(Role.COMMAND)
        start = [float(x) for x in raw.welcome["home"]]
        start[JOINT] += NEARER
        arms = stack.enter_context(Arms(raw, keeps=True, start=start))
        driver = Driver(arms)
        try:
            whole = sum(driver.drive() for _ in range(drives))
        finally:
            enemy.terminate()
            enemy.join()
        least, near, count = least_distance(judge, arms)
        without = beyond(judge, start)
    return [
        Row(
            attack="fixtures removed with every key that may not, and without one, "
            f"while an arm is driven into the {FIXTURE}",
            tried=sent.value,
            had=int(least <= 0.0),
            unit="motions through a fixture",
            target="0",
            passed=least > 0.0 and whole == drives and near < AT_IT and without < 0.0,
            note=f"{whole} of {drives} drives ended before it and went back; least "
            f"distance of the {LINK} to it by MuJoCo {near * 1e3:.1f} mm in {count:,} "
            f"positions; {without * 1e3:.0f} mm where it was driven to",
            figures={"least_m": near, "driven_to_m": without},
        )
    ]


def least_distance(judge: Judge, arms: Arms) -> tuple[float, float, int]:
    """Least distances of all links to fixtures and of the driven one to its own [m]."""
    names = set(fixed())
    pairs = [
        (a, b) for a, b in judge.pairs if {judge.owners[a], judge.owners[b]} & names
    ]
    own = [
        (a, b)
        for a, b in pairs
        if {judge.owners[a], judge.owners[b]} == {LINK, FIXTURE}
    ]
    least = near = FAR
    rows = arms.trace[::EACH]
    for row in rows:
        judge.place(np.array(row))
        least = min(least, *(judge.gap(pair, FAR) for pair in pairs))
        near = min(near, *(judge.gap(pair, FAR) for pair in own), FAR)
    return least, near, len(rows)


def beyond(judge: Judge, start: list[float]) -> float:
    """Distance of the driven link to its fixture where it was driven to [m]."""
    names = {LINK, FIXTURE}
    q = np.array(start)
    q[JOINT] += BEYOND
    judge.place(q)
    pairs = (pair for pair in judge.pairs if {judge.owners[k] for k in pair} == names)
    return min(judge.gap(pair, FAR) for pair in pairs)
