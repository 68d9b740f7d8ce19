"""Test motions: one joint moves from home towards the limit of its headroom."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import inf, isfinite, pi, sqrt

from armguard.guard.loop import Loop
from armguard.guard.settling import HARDEST, SWING_SPEED
from armguard.guard.watch import SLOW_TIME_DEFAULT
from armguard.robot.stopping.distance import stop_travel
from armguard.robot.stopping.figures import StoppingFigures
from armguard.scene.tables import RobotPart, SceneTables

# Positions tested from home to each limit, and bisections of the step that is blocked.
STEPS = 8
HALVINGS = 8

# Range that is tested for a joint without limits [rad].
FAR = pi

# Time in which the joint accelerates to its speed [s].
RISE = 0.05

# Lengths of an approach that are tried: multiple of the joint's stopping distance, and
# multiple of the time in which it is slowed, travelled at full speed before that [-].
WAYS = ((1.2, 1.5), (2.0, 3.0))

# Multiple of that length at which a robot that does not stop starts [-].
MORE_WAYS = 3.0

# Test speed: braking from it takes this long [s].
BRAKED = 0.1

# Ratio of test speed to settling speed from which a lagging stop is detectable [-].
ABOVE_SWING = 1.5

# Greatest test speed as a share of the joint's top speed [-].
OF_TOP = 0.9


@dataclass(frozen=True, slots=True)
class Approach:
    """Motion of one joint towards a buffer, all other joints at home.

    Attributes:
        robot: The joint's robot.
        joint: Index of the joint in q.
        start: Start position [rad or m].
        far: Start position with more room, for a robot that does not stop [rad or m].
        direction: 1 or -1.
        speed: Test speed [rad/s or m/s].
        shows_lag: Whether a lagging stop differs from settling at this speed.
    """

    robot: RobotPart
    joint: int
    start: float
    far: float
    direction: int
    speed: float
    shows_lag: bool

    @property
    def figures(self) -> StoppingFigures:
        """Stopping figures of the robot."""
        assert self.robot.stopping is not None
        return self.robot.stopping

    @property
    def place(self) -> int:
        """Index of the joint among those of its robot."""
        return self.joint - self.robot.first_joint


def find_approaches(guard: Loop) -> Iterator[Approach]:
    """Approaches that end below a buffer, with room to accelerate and to be slowed."""
    tables = guard.tables
    if not is_clear(guard, 0, float(tables.home[0])):
        return
    for robot in tables.robots:
        if robot.mode == "fixed" or robot.stopping is None:
            continue
        for place in range(robot.joint_count):
            j = robot.first_joint + place
            speed, shows_lag = test_speed(robot.stopping, place)
            stop = stop_travel(robot.stopping, place, speed, tables.period, tables.late)
            ends = {side: free_end(guard, j, side) for side in (1, -1)}
            for side, (stops, slows) in product((1, -1), WAYS):
                end, is_broken = ends[side]
                behind, behind_is_broken = ends[-side]
                way = stops * stop.travel + speed * (slows * SLOW_TIME_DEFAULT + RISE)
                start = end - side * way
                room = side * (start - behind) - (0.25 * way if behind_is_broken else 0)
                if is_broken and room >= 0.0:
                    far = start - side * min(room, MORE_WAYS * way)
                    yield Approach(robot, j, start, far, side, speed, shows_lag)


def test_speed(figures: StoppingFigures, place: int) -> tuple[float, bool]:
    """Test speed of a joint [rad/s], and whether it makes a lagging stop detectable."""
    swing = float(figures.settle[place])
    least = float(figures.deceleration[place])
    hardest = min(float(figures.deceleration_most[place]), HARDEST * least)
    settling = sqrt(2.0 * hardest * swing)
    if figures.settle_time > 0.0:
        settling = max(settling, SWING_SPEED * swing / figures.settle_time)
    error = float(figures.velocity_error[place])
    wanted = max(BRAKED * least, 2.0 * settling + 4.0 * error)
    speed = min(wanted, OF_TOP * float(figures.velocity[place]))
    return speed, speed > ABOVE_SWING * settling + 2.0 * error


def free_end(guard: Loop, joint: int, side: int) -> tuple[float, bool]:
    """Last position of a joint on one side of home at which all buffers are kept.

    Returns:
        That position [rad or m], and False if it is the joint's limit, True if a pair
        would break its buffer beyond it.
    """
    tables = guard.tables
    home = float(tables.home[joint])
    limit = float((tables.upper if side > 0 else tables.lower)[joint])
    if not isfinite(limit):
        limit = home + side * FAR
    clear = home
    for k in range(1, STEPS + 1):
        position = home + (limit - home) * k / STEPS
        if not is_clear(guard, joint, position):
            break
        clear = position
    else:
        return limit, False
    for _ in range(HALVINGS):
        middle = 0.5 * (clear + position)
        if is_clear(guard, joint, middle):
            clear = middle
        else:
            position = middle
    return clear, True


def is_clear(guard: Loop, joint: int, position: float) -> bool:
    """Whether every pair keeps its buffer with one joint displaced from home."""
    q = guard.home
    q[joint] = position
    nearest = guard.judge_at_rest(q).nearest
    return (inf if nearest is None else nearest.headroom) >= 0.0


def has_stops(tables: SceneTables) -> bool:
    """Whether stops are predicted for at least one robot."""
    return any(robot.mode != "fixed" for robot in tables.robots)
