"""Where in a scene one joint can be led towards something it must keep away from."""

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

# Positions tried from home to each limit, and halvings of the step that binds.
STEPS = 8
HALVINGS = 8

# A joint without limits is led this far [rad].
FAR = pi

# Time in which the joint gets its speed [s].
RISE = 0.05

# Lengths of a way that are tried: how often the joint's own stop, and for how often the
# time in which it is slowed it goes on before that [-].
WAYS = ((1.2, 1.5), (2.0, 3.0))

# How often this way farther off a robot starts that does not stop [-].
MORE_WAYS = 3.0

# Share of a second of braking that gives the speed [s].
BRAKED = 0.1

# How much faster than its settling a joint must be for a stop that lags to show [-].
ABOVE_SWING = 1.5

# Share of its top speed a joint is led at, at most [-].
OF_TOP = 0.9


@dataclass(frozen=True, slots=True)
class Approach:
    """One joint's way towards something, the others standing at home.

    Attributes:
        robot: The joint's robot.
        joint: Its place in q.
        start: Where it starts [rad or m].
        far: Where it may start with more room, for a robot that does not stop.
        direction: 1 or -1.
        speed: Speed it gets [rad/s or m/s].
        shows_lag: Whether it is so fast that a stop that lags differs from settling.
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
        """How the robot stops."""
        assert self.robot.stopping is not None
        return self.robot.stopping

    @property
    def place(self) -> int:
        """The joint's place among the robot's."""
        return self.joint - self.robot.first_joint


def find_approaches(guard: Loop) -> Iterator[Approach]:
    """Ways that end nearer to something than its buffer, with room to get there."""
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
    """Speed a joint is led at, and whether a stop that lags shows at it [rad/s]."""
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
    """How far a joint can go from home, and whether something binds there.

    Returns:
        The last position known to be clear, and False if that is the joint's limit.
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
    """Whether every pair keeps its buffer with one joint off home."""
    q = guard.home
    q[joint] = position
    nearest = guard.judge_at_rest(q).nearest
    return (inf if nearest is None else nearest.clearance) >= 0.0


def has_stops(tables: SceneTables) -> bool:
    """Whether stops of any robot are predicted."""
    return any(robot.mode != "fixed" for robot in tables.robots)
