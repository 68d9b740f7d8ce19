"""Stopping figures of the robots by name: published where we found them, else assumed.

Every figure says in `sources` where it is from. What holds the word "assumption:" we
could not trace to its maker: it is a guess, meant to be on the careful side, to be
replaced by your robot's manual or by a measurement of yours.
"""

from collections.abc import Mapping
from math import radians
from typing import Any

from armguard.robot.model import RobotModel
from armguard.robot.stopping.declared import ASSUMPTION
from armguard.robot.stopping.figures import StoppingFigures, stopping_figures

# Speed at which the maker of the UR3 and UR5 measured their stops [rad/s].
UR_SPEED = radians(183.0)

HALF = ASSUMPTION + "half the acceleration"
TWICE = ASSUMPTION + "twice the least deceleration"
AS_STOP = ASSUMPTION + "a brake holds no less than a controlled stop; not published"
TRUE = ASSUMPTION + "0: the URDF is right, and the base stands where the scene says"

PANDA_ARM = {f"panda_joint{k + 1}": k for k in range(7)}
PANDA_FINGER = "panda_finger_joint1"
PANDA_ACCELERATION = (15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0)

UR_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)

BAXTER_ARM = tuple(
    f"{side}_{joint}"
    for side in ("right", "left")
    for joint in ("s0", "s1", "e0", "e1", "w0", "w1", "w2")
)
BAXTER_FINGERS = ("l_gripper_l_finger_joint", "r_gripper_l_finger_joint")

# A figure, a number or one by joint, and where it is from.
Row = tuple[Any, str]


def doubled(by_joint: Mapping[str, float], factor: float = 2.0) -> dict[str, float]:
    """A figure by joint, times a factor."""
    return {joint: factor * value for joint, value in by_joint.items()}


def panda() -> dict[str, Row]:
    """Franka's Panda with its hand."""
    acceleration = {j: PANDA_ACCELERATION[k] for j, k in PANDA_ARM.items()}
    acceleration[PANDA_FINGER] = 2.0
    least = doubled(acceleration, 0.5)
    least[PANDA_FINGER] = 1.0
    return {
        "velocity": (
            {
                **{j: 2.175 if k < 4 else 2.61 for j, k in PANDA_ARM.items()},
                PANDA_FINGER: 0.2,
            },
            "Franka's limits of the control interface; fingers: the URDF's",
        ),
        "acceleration": (
            acceleration,
            "Franka's limits of the control interface; fingers: assumption: 2 m/s²",
        ),
        "deceleration": (least, HALF + " limit; we know of none that is published"),
        "deceleration_most": (doubled(least), TWICE),
        "ramp": (
            0.002,
            "Franka's limits of the control interface: acceleration over jerk",
        ),
        "settle": (
            {**dict.fromkeys(PANDA_ARM, 0.002), PANDA_FINGER: 0.0005},
            ASSUMPTION + "2 mrad, fingers 0.5 mm, after a stop from top speed",
        ),
        "settle_time": (0.1, ASSUMPTION + "0.1 s"),
        "brake_delay": (0.1, ASSUMPTION + "0.1 s; not published"),
        "brake_deceleration": (least, AS_STOP),
        "position_error": (
            {**dict.fromkeys(PANDA_ARM, 2e-4), PANDA_FINGER: 5e-4},
            ASSUMPTION + "0.2 mrad, fingers 0.5 mm",
        ),
        "velocity_error": (
            {**dict.fromkeys(PANDA_ARM, 0.01), PANDA_FINGER: 0.002},
            ASSUMPTION + "0.01 rad/s, fingers 2 mm/s",
        ),
        "tracking_error": (
            {**dict.fromkeys(PANDA_ARM, 0.02), PANDA_FINGER: 0.004},
            ASSUMPTION + "0.02 rad/s, fingers 4 mm/s",
        ),
        "sensing": (0.002, ASSUMPTION + "two cycles of the 1 kHz interface"),
        "command": (0.003, ASSUMPTION + "three cycles of the 1 kHz interface"),
        "stale": (0.010, ASSUMPTION + "ten cycles of the 1 kHz interface"),
    }


def universal(
    velocity: tuple[float, ...], speeds: str, least: tuple[float, ...], source: str
) -> dict[str, Row]:
    """A robot of Universal Robots, CB3.

    Args:
        velocity: Top speeds in the order of `UR_JOINTS` [rad/s].
        speeds: Where these are from.
        least: Least decelerations [rad/s²].
        source: Where these are from.
    """
    deceleration = dict(zip(UR_JOINTS, least, strict=True))
    return {
        "velocity": (
            dict(zip(UR_JOINTS, velocity, strict=True)),
            speeds,
        ),
        "acceleration": (
            {j: max(40.0, 2.0 * a) for j, a in deceleration.items()},
            ASSUMPTION + "40 rad/s², or twice the deceleration; not published",
        ),
        "deceleration": (
            deceleration,
            ASSUMPTION
            + "a controlled stop brakes as a category 0 stop does: "
            + source,
        ),
        "deceleration_most": (doubled(deceleration), TWICE),
        "ramp": (0.02, ASSUMPTION + "20 ms; not published"),
        "settle": (0.003, ASSUMPTION + "3 mrad after a stop from top speed"),
        "settle_time": (0.1, ASSUMPTION + "0.1 s"),
        "brake_delay": (0.05, ASSUMPTION + "50 ms on top of the deceleration"),
        "brake_deceleration": (deceleration, source),
        "position_error": (5e-4, ASSUMPTION + "0.5 mrad"),
        "velocity_error": (0.02, ASSUMPTION + "0.02 rad/s"),
        "tracking_error": (0.02, ASSUMPTION + "0.02 rad/s"),
        "sensing": (0.010, ASSUMPTION + "a cycle of the 125 Hz interface, and 2 ms"),
        "command": (0.016, ASSUMPTION + "two cycles of the 125 Hz interface"),
        "stale": (0.032, ASSUMPTION + "four cycles of the 125 Hz interface"),
    }


def mean_brake(time: float, travel: float) -> float:
    """Deceleration from `UR_SPEED` that takes no less time and way than measured.

    Args:
        time: Stopping time [s].
        travel: Stopping distance [rad].

    Returns:
        Deceleration [rad/s²].
    """
    return min(UR_SPEED / time, UR_SPEED**2 / (2.0 * travel))


def ur3() -> dict[str, Row]:
    """Universal Robots UR3, CB3."""
    base, shoulder, elbow = (
        mean_brake(0.159, 0.18),
        mean_brake(0.154, 0.20),
        mean_brake(0.092, 0.15),
    )
    return universal(
        (*3 * (UR_SPEED,), *3 * (radians(360.0),)),
        "183 °/s, at which the maker measured stops; wrists: assumption: 360 °/s, as "
        "we remember the data sheet",
        (base, shoulder, elbow, base, base, base),
        "UR3/CB3 user manual, appendix A, 183 °/s, 3 kg, stretched: base 0.18 rad in "
        "159 ms, shoulder 0.20 rad in 154 ms, elbow 0.15 rad in 92 ms; wrists are not "
        "published, assumption: as the base",
    )


def ur5() -> dict[str, Row]:
    """Universal Robots UR5, CB3."""
    base, shoulder, elbow = (
        mean_brake(0.244, 0.31),
        mean_brake(0.530, 0.70),
        mean_brake(0.164, 0.22),
    )
    return universal(
        (*3 * (UR_SPEED,), *3 * (3.2,)),
        "183 °/s, at which the maker measured stops; wrists: the URDF's",
        (base, shoulder, elbow, base, base, base),
        "UR5/CB3 user manual, appendix A, 183 °/s, 5 kg, stretched: base 0.31 rad in "
        "244 ms, shoulder 0.70 rad in 530 ms, elbow 0.22 rad in 164 ms; wrists are not "
        "published, assumption: as the base",
    )


def ur10() -> dict[str, Row]:
    """Universal Robots UR10, CB3."""
    return universal(
        (2.16, 2.16, 3.15, *3 * (3.2,)),
        "the URDF's speed limits",
        (4.0, 4.0, 6.0, 10.0, 10.0, 10.0),
        ASSUMPTION + "4, 4, 6 and 10 rad/s², below the UR5's; we know of no figures by "
        "joint",
    )


def xarm7() -> dict[str, Row]:
    """UFACTORY xArm 7."""
    return {
        "velocity": (radians(180.0), "the URDF's speed limits: 180 °/s"),
        "acceleration": (20.0, ASSUMPTION + "1145 °/s², as we remember the manual"),
        "deceleration": (10.0, HALF + " limit"),
        "deceleration_most": (20.0, TWICE),
        "ramp": (0.040, ASSUMPTION + "1145 °/s² over 28647 °/s³, as remembered"),
        "settle": (0.003, ASSUMPTION + "3 mrad after a stop from top speed"),
        "settle_time": (0.15, ASSUMPTION + "0.15 s"),
        "brake_delay": (
            0.3,
            "the maker's user manual (xArm 6): power off within 300 ms of the button",
        ),
        "brake_deceleration": (10.0, AS_STOP),
        "position_error": (5e-4, ASSUMPTION + "0.5 mrad"),
        "velocity_error": (0.02, ASSUMPTION + "0.02 rad/s"),
        "tracking_error": (0.02, ASSUMPTION + "0.02 rad/s"),
        "sensing": (0.012, ASSUMPTION + "a report at 100 Hz, and 2 ms"),
        "command": (0.012, ASSUMPTION + "12 ms"),
        "stale": (0.040, ASSUMPTION + "four reports at 100 Hz"),
    }


def kinova() -> dict[str, Row]:
    """Kinova's Jaco with six joints and a spherical wrist."""
    return {
        "velocity": (
            {
                f"j2s6s200_joint_{k}": radians(36.0 if k < 4 else 48.0)
                for k in range(1, 7)
            },
            "the URDF's speed limits: 36 and 48 °/s",
        ),
        "acceleration": (3.0, ASSUMPTION + "3 rad/s²; not published"),
        "deceleration": (1.5, HALF),
        "deceleration_most": (3.0, TWICE),
        "ramp": (0.05, ASSUMPTION + "50 ms; not published"),
        "settle": (0.01, ASSUMPTION + "10 mrad after a stop from top speed"),
        "settle_time": (0.3, ASSUMPTION + "0.3 s"),
        "brake_delay": (0.1, ASSUMPTION + "0.1 s; we know of no brakes, it may sink"),
        "brake_deceleration": (1.5, AS_STOP),
        "position_error": (2e-3, ASSUMPTION + "2 mrad"),
        "velocity_error": (0.05, ASSUMPTION + "0.05 rad/s"),
        "tracking_error": (0.05, ASSUMPTION + "0.05 rad/s"),
        "sensing": (0.012, ASSUMPTION + "a report at 100 Hz, and 2 ms"),
        "command": (0.020, ASSUMPTION + "two cycles at 100 Hz"),
        "stale": (0.040, ASSUMPTION + "four reports at 100 Hz"),
    }


def baxter() -> dict[str, Row]:
    """Rethink's Baxter with electric grippers."""

    def by_joint(arm: float, head: float, finger: float) -> dict[str, float]:
        return {
            "head_pan": head,
            **dict.fromkeys(BAXTER_ARM, arm),
            **dict.fromkeys(BAXTER_FINGERS, finger),
        }

    speeds = by_joint(2.0, 5.0, 0.2)
    speeds |= {joint: 4.0 for joint in BAXTER_ARM if "_w" in joint}
    least = by_joint(4.0, 4.0, 1.0)
    return {
        "velocity": (
            speeds,
            ASSUMPTION
            + "2 rad/s, wrists 4 rad/s, as we remember the specifications (the "
            "URDF has 1.5 and 4); head and fingers 5 rad/s and 0.2 m/s, where the "
            "URDF's are no limits",
        ),
        "acceleration": (
            by_joint(8.0, 8.0, 2.0),
            ASSUMPTION + "8 rad/s², fingers 2 m/s²; not published",
        ),
        "deceleration": (least, HALF),
        "deceleration_most": (doubled(least), TWICE),
        "ramp": (0.05, ASSUMPTION + "50 ms, its actuators are springs"),
        "settle": (
            by_joint(0.03, 0.03, 0.001),
            ASSUMPTION
            + "30 mrad after a stop from top speed, its actuators are springs",
        ),
        "settle_time": (0.5, ASSUMPTION + "0.5 s"),
        "brake_delay": (0.2, ASSUMPTION + "0.2 s; not published"),
        "brake_deceleration": (least, AS_STOP),
        "position_error": (
            by_joint(5e-3, 5e-3, 5e-4),
            ASSUMPTION + "5 mrad, fingers 0.5 mm",
        ),
        "velocity_error": (
            by_joint(0.05, 0.05, 0.005),
            ASSUMPTION + "0.05 rad/s, fingers 5 mm/s",
        ),
        "tracking_error": (
            by_joint(0.05, 0.05, 0.005),
            ASSUMPTION + "0.05 rad/s, fingers 5 mm/s",
        ),
        "sensing": (0.012, ASSUMPTION + "a report at 100 Hz, and 2 ms"),
        "command": (0.020, ASSUMPTION + "two cycles at 100 Hz"),
        "stale": (0.040, ASSUMPTION + "four reports at 100 Hz"),
    }


def z1() -> dict[str, Row]:
    """Unitree's Z1 with its gripper."""
    return {
        "velocity": (radians(180.0), "the URDF's speed limits: 180 °/s"),
        "acceleration": (16.0, ASSUMPTION + "16 rad/s²; not published"),
        "deceleration": (8.0, HALF),
        "deceleration_most": (16.0, TWICE),
        "ramp": (0.02, ASSUMPTION + "20 ms; not published"),
        "settle": (0.005, ASSUMPTION + "5 mrad after a stop from top speed"),
        "settle_time": (0.15, ASSUMPTION + "0.15 s"),
        "brake_delay": (0.1, ASSUMPTION + "0.1 s; we know of no brakes, it may sink"),
        "brake_deceleration": (8.0, AS_STOP),
        "position_error": (1e-3, ASSUMPTION + "1 mrad"),
        "velocity_error": (0.02, ASSUMPTION + "0.02 rad/s"),
        "tracking_error": (0.02, ASSUMPTION + "0.02 rad/s"),
        "sensing": (0.004, ASSUMPTION + "two cycles of the 500 Hz interface"),
        "command": (0.006, ASSUMPTION + "three cycles of the 500 Hz interface"),
        "stale": (0.020, ASSUMPTION + "ten cycles of the 500 Hz interface"),
    }


NAMED = {
    "baxter": baxter,
    "kinova": kinova,
    "panda": panda,
    "panda_capsules": panda,
    "ur3": ur3,
    "ur5": ur5,
    "ur10": ur10,
    "xarm7": xarm7,
    "z1": z1,
}


def named_figures(name: str, model: RobotModel) -> StoppingFigures | None:
    """Stopping figures of a robot by name, None if it has none.

    Args:
        name: Its name in `armguard.robot.named.ROBOTS`.
        model: The robot.
    """
    if name not in NAMED:
        return None
    rows = NAMED[name]()
    sources = {key: source for key, (_, source) in rows.items()}
    for key in ("model_error", "base_error", "base_turn"):
        sources[key] = TRUE
    return stopping_figures(
        model, **{key: value for key, (value, _) in rows.items()}, sources=sources
    )
