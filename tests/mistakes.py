"""Mistakes of users at each door, and what the answer holds: value, place, remedy.

The tests of each door play its table; `docs/first-mistakes.md` is written from them:
`python tests/mistakes.py` writes the page anew.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from armguard import Box, Capsule, Guard, Pose, Scene, Sphere
from arms import TURN_AND_LIFT
from motion_files import HEADER, table, times

PAGE = Path(__file__).parents[1] / "docs" / "first-mistakes.md"


class Mistake(NamedTuple):
    """A mistake, and three parts of its answer.

    Attributes:
        value: The wrong value, as the answer has it.
        place: Where it is: file and line, key, joint, robot, object or argument.
        remedy: What to do.
        given: The mistake itself: a text, or what makes it; see the test of its door.
        logged: Whether the answer is a warning of the log, and the input is used.
    """

    value: str
    place: str
    remedy: str
    given: Any
    logged: bool = False

    def missing(self, said: str) -> list[str]:
        """Parts that an answer does not hold."""
        return [part for part in self[:3] if part not in said]


def scene_text(
    period="0.02", stopping="{deceleration: 1.0}", robot="", rest="", urdf="r.urdf"
):
    """A scene file of two arms with one thing changed."""
    robot = robot or "home: {turn: 0.5, lift: 0.1}"
    return f"""cycle: {{period: {period}}}
robots:
  a: {{urdf: {urdf}, stopping: {stopping}, {robot}}}
  b: {{urdf: r.urdf, base: {{xyz: [3, 0, 0]}}, stopping: {{deceleration: 1.0}},
      home: {{turn: 0.5, lift: 0.1}}}}
{rest}
"""


def at_home(more):
    """An arm at home, with more said about it."""
    return scene_text(robot=f"home: {{turn: 0.5, lift: 0.1}}, {more}")


def with_object(what):
    """A scene with an object in line 6."""
    return scene_text(rest=f"objects: {{c: {{{what}}}}}")


BALL = "sphere: {radius: 0.1}, at: {xyz: [9, 0, 0]}"

# A text is the file; the answer is that of `armguard check`.
SCENE_FILE = {
    "degrees of a base": Mistake(
        *("is 90 rad", ":3: robots.a.base.rpy[2]", "give radians: 1.5708"),
        at_home("base: {rpy: [0, 0, 90]}"),
    ),
    "degrees of a home position": Mistake(
        *("at 45", ":3: robots.a: home puts joint 'turn'", "give radians"),
        scene_text(robot="home: {turn: 45}"),
    ),
    "degrees of a top speed": Mistake(
        *("is 180", "velocity of joint 'turn'", "give radians"),
        scene_text(stopping="{deceleration: 1, velocity: 180}"),
    ),
    "degrees of a deceleration": Mistake(
        *("is 57 rad/s²", "robot 'a': deceleration of joint 'turn'", "radians: 0.995"),
        scene_text(stopping="{deceleration: 57}"),
        logged=True,
    ),
    "millimetres of a buffer": Mistake(
        *("is 5 m", ":6: buffer", "give metres: 0.005"), scene_text(rest="buffer: 5")
    ),
    "millimetres of a base": Mistake(
        *("800 m", "robot 'a': base", "give metres: 0.8"),
        at_home("base: {xyz: [800, 0, 0]}"),
        logged=True,
    ),
    "millimetres of a box": Mistake(
        *("2000 m", "object 'c'", "give metres: 2"),
        with_object("box: [1200, 2000, 50], at: {xyz: [0, 0, -90]}"),
        logged=True,
    ),
    "millimetres of a mesh": Mistake(
        *("1200 m", "object 'c'", "give metres: 1.2"),
        with_object("mesh: {file: mm.obj}, at: {xyz: [0, 0, -9]}"),
        logged=True,
    ),
    "millimetres of a sliding joint": Mistake(
        *("at 100", ":3: robots.a: home puts joint 'lift'", "give metres"),
        scene_text(robot="home: {lift: 100}"),
    ),
    "millimetres of a grasp": Mistake(
        *("is 100 m", ":6: objects.c.graspable.near", "give metres: 0.1"),
        with_object(f"{BALL}, graspable: {{near: 100}}"),
    ),
    "millimetres of a contact": Mistake(
        *("is 2 m", ":6: objects.c.graspable.depth", "give metres: 0.002"),
        with_object(f"{BALL}, graspable: {{depth: 2}}"),
    ),
    "millimetres a second": Mistake(
        *("is 60 m/s", "object 'c': top_speed", "give 0.06"),
        with_object(f"{BALL}, top_speed: 60"),
        logged=True,
    ),
    "milliseconds of the period": Mistake(
        *("is 20 s", ":1: cycle.period", "20 ms are 0.02"), scene_text(period="20")
    ),
    "one millisecond": Mistake(
        *("is 1 s", "period", "give seconds: 0.001"),
        scene_text(period="1"),
        logged=True,
    ),
    "hertz": Mistake(
        *("is 500 s", ":1: cycle.period", "at 500 Hz it is 0.002"),
        scene_text(period="500"),
    ),
    "a rate": Mistake(
        *("there is no such key", ":1: cycle.rate", "give the period, {period: 0.02}"),
        scene_text().replace("period: 0.02", "rate: 50"),
    ),
    "milliseconds of a delay": Mistake(
        *("is 8", "robots.a.stopping.delays.sensing: sensing", "give seconds"),
        scene_text(stopping="{deceleration: 1, delays: {sensing: 8}}"),
    ),
    "NaN": Mistake(
        *("is nan", ":3: robots.a.home.turn", "it must be finite"),
        scene_text(robot="home: {turn: .nan}"),
    ),
    "infinity": Mistake(
        *("is inf", ":6: buffer", "it must be finite"), scene_text(rest="buffer: .inf")
    ),
    "two numbers of three": Mistake(
        *("got 2", ":3: robots.a.base.xyz", "expected 3 numbers"),
        scene_text(robot="base: {xyz: [0, 0]}"),
    ),
    "a decimal comma": Mistake(
        *("got 4", ":3: robots.a.base.xyz", "expected 3 numbers"),
        scene_text(robot="base: {xyz: [0,5, 0, 0]}"),
    ),
    "a unit beside a number": Mistake(
        *("got '5 rad/s2'", "a.stopping.deceleration", "expected a number"),
        scene_text(stopping="{deceleration: 5 rad/s2}"),
    ),
    "text for a number": Mistake(
        *("got '20ms'", ":1: cycle.period", "expected a number"),
        scene_text(period="20ms"),
    ),
    "a misspelt key": Mistake(
        *("there is no such key", ":3: robots.a.hme", "did you mean 'home'?"),
        scene_text(robot="hme: {turn: 0.5}"),
    ),
    "a quaternion without its order": Mistake(
        *("there is no such key", "robots.a.base.quat", "'quat_xyzw', 'quat_wxyz'?"),
        scene_text(robot="base: {quat: [1, 0, 0, 0]}"),
    ),
    "a quaternion that is not unit": Mistake(
        *("norm 0.5", ":3: robots.a.base: quat_wxyz", "it must be 1"),
        scene_text(robot="base: {quat_wxyz: [0.5, 0, 0, 0]}"),
    ),
    "two robots at one place": Mistake(
        *("coincide", "bases of 'a' and 'b'", "give one a base"),
        scene_text().replace("xyz: [3, 0, 0]", "xyz: [0, 0, 0]"),
    ),
    "another link": Mistake(
        *("'a/rodd'", ":6: objects.c", "did you mean 'a/rod'"),
        with_object("box: [1, 1, 1], attached_to: a/rodd"),
    ),
    "another joint": Mistake(
        *("'lfit'", ":3: robots.a.stopping.deceleration", "did you mean 'lift'?"),
        scene_text(stopping="{deceleration: {turn: 1, lfit: 1}}"),
    ),
    "a missing joint": Mistake(
        *("is missing", ":3: robots.a", "for joint 'lift'"),
        scene_text(stopping="{deceleration: {turn: 1}}"),
    ),
    "another robot": Mistake(
        *("'ur5e'", ":3: robots.a", "give a URDF, or one of the named robots: baxter"),
        scene_text(urdf="ur5e"),
    ),
    "positions as a list": Mistake(
        *("got [0.5, 0.1]", ":3: robots.a.home", "expected a mapping"),
        scene_text(robot="home: [0.5, 0.1]"),
    ),
    "a name twice": Mistake(
        *("'a' is there twice", ":4", "keep one"),
        scene_text().replace("  b: {", "  a: {"),
    ),
    "a missing file": Mistake(
        *("q.urdf' cannot be read", ":3: robots.a", "fix line 3 of bad.yaml"),
        scene_text(urdf="q.urdf"),
    ),
    "a tab": Mistake(
        *("found character '\\t'", ":2", "fix line 2 of bad.yaml"), "robots:\n\ta: {}\n"
    ),
    "a bracket that stays open": Mistake(
        *("got '<stream end>'", ":2", "expected ',' or '}'"), "robots: {a: {urdf: r\n"
    ),
    "an empty file": Mistake(
        *("must be a mapping", "bad.yaml", "with the key 'robots'"), ""
    ),
    "UTF-16": Mistake(
        *("cannot be read", "bad.yaml", "it is not UTF-8"),
        scene_text().encode("utf-16"),
    ),
}

ROW = "0,0.5,0.1,0.5,0.1"
GIVE = "write one number a column, with a decimal point"

# A text is the file; the answer is that of `armguard run`.
MOTION_FILE = {
    "degrees": Mistake(
        *("is at 45", "m.csv: configuration 2: joint 'a/turn'", "give radians"),
        table(ROW, "0.02,45,0.1,0.5,0.1"),
    ),
    "millimetres": Mistake(
        *("is at 100", "configuration 1: joint 'a/lift'", "give metres"),
        table("0,0.5,100,0.5,100"),
    ),
    "milliseconds": Mistake(
        *("20 s from one", "m.csv", "milliseconds; name the times 't_ms'"),
        times(0, 20, 40),
    ),
    "microseconds": Mistake(
        *("20000 s from one", "m.csv", "name the times 't_us'"), times(0, 2e4, 4e4)
    ),
    "nanoseconds": Mistake(
        *("2e+07 s from one", "m.csv", "name the times 't_ns'"), times(0, 2e7, 4e7)
    ),
    "nanoseconds of arms at rest": Mistake(
        *("2e+07 s from one", "m.csv", "name the times 't_ns'"),
        times(0, 2e7, 4e7, moves=0),
    ),
    "microseconds since 1970": Mistake(
        *("1.7e+15", "m.csv: 't'", "name its unit: 't_ms'"),
        times(1.7e15, 1.7e15 + 2e4),
    ),
    "times that are too short": Mistake(
        *("500 times its speed limit", "joint 'a/turn'", "write the unit"),
        times(0, 2e-5, 4e-5),
    ),
    "NaN": Mistake(
        *("is at nan", "joint 'a/lift'", "it must be finite"),
        table("0,0.5,nan,0.5,0.1"),
    ),
    "infinity": Mistake(
        *("is at inf", "joint 'a/lift'", "it must be finite"),
        table("0,0.5,inf,0.5,0.1"),
    ),
    "a NaN time": Mistake(
        *("is nan", "the time of configuration 2", "give a finite time, or delete the"),
        times(0, np.nan, 0.04),
    ),
    "an infinite time": Mistake(
        *("is inf", "the time of configuration 2", "give a finite time"),
        times(0, np.inf),
    ),
    "times that go back": Mistake(
        *("from 0.04 s to 0.02 s", "at configuration 3", "it must not go back: sort"),
        times(0, 0.04, 0.02),
    ),
    "a time twice": Mistake(
        *("the time 0.02 s", "configurations 2 and 3", "correct a time"),
        times(0, 0.02, 0.02, 0.04),
    ),
    "one time for all": Mistake(
        *("the time 3 s", "all 3 configurations", "correct the times, or leave them"),
        times(3, 3, 3, moves=0),
    ),
    "two columns of times": Mistake(
        *("are both times", "m.csv:1: columns 'time' and 't'", "delete one"),
        table("0," + ROW, header="time," + HEADER),
    ),
    "times without their name": Mistake(
        *("joint 'z'", "m.csv", "if it holds times, name it 't'"),
        table(ROW, ROW.replace("0", "1", 1), header="z" + HEADER[1:]),
    ),
    "joints in reverse order": Mistake(
        *("is at 0.5000", "joint 'a/lift'", "seem to be in reverse order"),
        table(ROW, header="t,b/lift,b/turn,a/lift,a/turn"),
    ),
    "another joint": Mistake(
        *("'a/lfit'", "m.csv: joint", "did you mean 'a/lift'"),
        table(ROW, header=HEADER.replace("a/lift", "a/lfit")),
    ),
    "another robot": Mistake(
        *("no robot is 'c'", "joint 'c/turn'", "known names are 'a', 'b'"),
        table(ROW, header=HEADER.replace("a/", "c/")),
    ),
    "a joint of either robot": Mistake(
        *("joint 'turn'", "may be 'a/turn' or 'b/turn'", "write the robot's name"),
        table("0,0.5,0.1", header="t,turn,lift"),
    ),
    "a missing joint": Mistake(
        *("no positions for", "'b/lift'", "hold them at home with --hold-home"),
        table("0,0.5,0.1,0.5", header="t,a/turn,a/lift,b/turn"),
    ),
    "a column twice": Mistake(
        *("'a/turn' is there twice", "m.csv:1", "delete one"),
        table(ROW, header=HEADER.replace("b/turn", "a/turn")),
    ),
    "a joint by two names": Mistake(
        *("'a/turn' and 'a_turn'", "joint 'a/turn'", "delete one"),
        table(ROW, header=HEADER.replace("b/turn", "a_turn")),
    ),
    "no header": Mistake(
        *("it holds numbers", "m.csv:1", "the first line must hold the joint names"),
        ROW + "\n",
    ),
    "no row": Mistake(
        *("there is no configuration", "m.csv", "give at least one"), table()
    ),
    "an empty file": Mistake(
        *("the first line", "m.csv:1", "must hold the joint names"), ""
    ),
    "a row that is too short": Mistake(
        *("3 columns; the header has 5", "m.csv:3", GIVE), table(ROW, "0.02,0.5,0.1")
    ),
    "decimal commas": Mistake(
        *("9 columns; the header has 5", "m.csv:2", GIVE), table("0,0,5,0,1,0,5,0,1")
    ),
    "a decimal comma in quotes": Mistake(
        *("'0,5' is no number", "m.csv:2", GIVE), table('0,"0,5",0.1,0.5,0.1')
    ),
    "another separator": Mistake(
        *("1 columns; the header has 5", "m.csv:2", GIVE),
        table(ROW, header=HEADER.replace(",", ";")),
    ),
    "text": Mistake(
        *("'half' is no number", "m.csv:2", GIVE), table("0,half,0.1,0.5,0.1")
    ),
    "an empty cell": Mistake(
        *("'' is no number", "in column 'a/turn'", GIVE), table("0,,0.1,0.5,0.1")
    ),
    "a date": Mistake(
        *("'2026-01-01T00:00:00' is no number", "in column 't'", GIVE),
        table("2026-01-01T00:00:00,0.5,0.1,0.5,0.1"),
    ),
    "UTF-16": Mistake(
        *("is no text in UTF-8", "'m.csv'", "save it as CSV in UTF-8"),
        times(0, 0.02).encode("utf-16"),
    ),
}


def urdf(old, new):
    """The file of the arm with one thing changed."""
    assert old in TURN_AND_LIFT
    return TURN_AND_LIFT.replace(old, new)


LIMIT = 'lower="0.1" upper="2" effort="1" velocity="1"'
DEGREES = LIMIT.replace('"2"', '"120"').replace("0.1", "-120")

# A text is the URDF; the answer is that of `Scene.add_robot`.
ROBOT_FILE = {
    "degrees of limits": Mistake(
        *("[-120, 120] rad", "joint 'turn' in line 8", "give radians: [-2.094, 2.094]"),
        urdf(LIMIT, DEGREES),
        logged=True,
    ),
    "millimetres of a link": Mistake(
        *("300 m", "robot 'a': link 'base'", "give metres: 0.3"),
        urdf('radius="0.3"', 'radius="300"'),
        logged=True,
    ),
    "millimetres of a frame": Mistake(
        *("500 m", "robot 'a': link 'rod'", "give metres: 0.5"),
        urdf('xyz="0.5 0 0"', 'xyz="500 0 0"'),
        logged=True,
    ),
    "NaN": Mistake(
        *('is "nan"', "'r.urdf' line 9: <limit> lower", "it must be a finite number"),
        urdf(LIMIT, LIMIT.replace("0.1", "nan")),
    ),
    "limits exchanged": Mistake(
        *("limit 3.0", "'r.urdf' line 9: joint 'turn'", "above its upper 2.0"),
        urdf(LIMIT, LIMIT.replace("0.1", "3")),
    ),
    "no limits": Mistake(
        *("is revolute", "'r.urdf' line 8: joint 'turn'", "has no <limit lower upper>"),
        urdf(f"<limit {LIMIT}/>", ""),
    ),
    "another link": Mistake(
        *("parent link 'bse'", "line 8: joint 'turn'", "did you mean 'base'?"),
        urdf('<parent link="base"/>', '<parent link="bse"/>'),
    ),
    "a negative radius": Mistake(
        *('is "-0.3"', "'r.urdf' line 3: <sphere> radius", "it must be > 0"),
        urdf('radius="0.3"', 'radius="-0.3"'),
    ),
    "text for a number": Mistake(
        *('is "half"', "line 9: <limit> upper", "it must be a finite number"),
        urdf('upper="2"', 'upper="half"'),
    ),
    "two numbers of three": Mistake(
        *('is "0 1.5"', "line 2: <origin> xyz", "it must be 3 finite numbers"),
        urdf('xyz="0 1.5 0"', 'xyz="0 1.5"'),
    ),
    "a tag that stays open": Mistake(
        *("is not XML", "'r.urdf'", "Premature end of data in tag robot"),
        urdf("</robot>", ""),
    ),
    "MJCF": Mistake(
        *(
            "<mujoco>",
            "'r.urdf'",
            "it must be <robot>; MJCF is not read, name the URDF",
        ),
        "<mujoco/>",
    ),
}


def with_arm(**given):
    """Adds the arm to a scene."""
    return lambda scene, urdf: scene.add_robot(urdf, "a", **given)


def with_part(*given, **named):
    """Adds an object to a scene."""
    return lambda scene, _: scene.add(*given, **named)


def alone(**given):
    """Makes a scene."""
    return lambda scene, _: Scene(**given)


def at_one_place(scene, urdf):
    """Guards two arms whose bases coincide."""
    for name in ("a", "b"):
        scene.add_robot(
            urdf,
            name,
            stopping={"deceleration": 1.0},
            home={"turn": 0.5, "lift": 0.1},
        )
    Guard(scene, self_test=False)


CUBE = Box(size=(1, 1, 1))
IN_MILLIMETRES = ([(0, 0, 0), (1200, 0, 0), (0, 800, 0)], [(0, 1, 2)])

# A function makes or fills a scene; the answer is what it raises or logs.
CALLS = {
    "degrees of a pose": Mistake(
        *("[0.0, 0.0, 90.0]", "rpy", "give radians"),
        lambda *_: Pose(rpy=(0, 0, 90)),
    ),
    "few degrees of a pose": Mistake(
        *("[0.0, 0.0, 10.0]", "robot 'a': base: rpy", "give radians"),
        with_arm(base=Pose(rpy=(0, 0, 10))),
    ),
    "degrees of a home position": Mistake(
        *("at 45", "home puts joint 'turn'", "give radians"),
        with_arm(home={"turn": 45}),
    ),
    "degrees of a figure": Mistake(
        *("is 500", "deceleration of joint 'turn'", "give radians"),
        with_arm(stopping={"deceleration": 500}),
    ),
    "degrees of a deceleration": Mistake(
        *("is 57 rad/s²", "deceleration of joint 'turn'", "give radians: 0.995"),
        with_arm(stopping={"deceleration": 57}),
        logged=True,
    ),
    "milliseconds": Mistake(*("is 20 s", "period", "20 ms are 0.02"), alone(period=20)),
    "one millisecond": Mistake(
        *("is 1 s", "period", "give seconds: 0.001"), alone(period=1), logged=True
    ),
    "milliseconds late": Mistake(*("is 5 s", "late", "5 ms are 0.005"), alone(late=5)),
    "millimetres of a buffer": Mistake(
        *("is 30 m", "buffer", "give metres: 0.03"), alone(buffer=30)
    ),
    "millimetres of the margin": Mistake(
        *("is 500 m", "margin", "give metres: 0.5"), alone(margin=500)
    ),
    "millimetres of a fit": Mistake(
        *("is 30 m", "robot 'a': fit_target", "give metres: 0.03"),
        with_arm(fit_target=30),
    ),
    "millimetres of a joint": Mistake(
        *("at 100", "home puts joint 'lift'", "give metres"),
        with_arm(home={"lift": 100}),
    ),
    "millimetres of a base": Mistake(
        *("50 m", "robot 'a': base", "give metres: 0.05"),
        with_arm(base=Pose(xyz=(50, 0, 0))),
        logged=True,
    ),
    "millimetres of a box": Mistake(
        *("2000 m", "object 't'", "give metres: 2"),
        with_part(Box(size=(1200, 2000, 50)), "t"),
        logged=True,
    ),
    "millimetres of a capsule": Mistake(
        *("300 m", "object 't'", "give metres: 0.3"),
        with_part(Capsule(start=(0, 0, 0), end=(0, 0, 300), radius=50), "t"),
        logged=True,
    ),
    "millimetres of a place": Mistake(
        *("800 m", "object 't': pose", "give metres: 0.8"),
        with_part(CUBE, "t", pose=Pose(xyz=(0, -800, 0))),
        logged=True,
    ),
    "millimetres of a mesh": Mistake(
        *("1200 m", "object 't'", "give metres: 1.2"),
        lambda scene, _: scene.add_mesh(IN_MILLIMETRES, "t"),
        logged=True,
    ),
    "millimetres a second": Mistake(
        *("is 1600 m/s", "object 't': top_speed", "give metres"),
        with_part(Sphere(radius=0.1), "t", top_speed=1600),
    ),
    "few millimetres a second": Mistake(
        *("is 60 m/s", "object 't': top_speed", "give 0.06"),
        with_part(Sphere(radius=0.1), "t", top_speed=60),
        logged=True,
    ),
    "NaN": Mistake(
        *("is nan s", "period", "it must be finite and >= 0"), alone(period=np.nan)
    ),
    "text for a number": Mistake(
        *("'20ms'", "period", "it must be a number [s]"), alone(period="20ms")
    ),
    "a flag for a number": Mistake(
        *("is True", "buffer", "it must be a number [m]"), alone(buffer=True)
    ),
    "text for a position": Mistake(
        *("at '0.5'", "home puts joint 'turn'", "it must be a number [rad or m]"),
        with_arm(home={"turn": "0.5"}),
    ),
    "text for a figure": Mistake(
        *("is '5'", "deceleration", "it must be a number, or numbers by joint name"),
        with_arm(stopping={"deceleration": "5"}),
    ),
    "positions as a list": Mistake(
        *("[0.5, 0.1]", "robot 'a': home", "give a mapping by name, such as {'turn'"),
        with_arm(home=[0.5, 0.1]),
    ),
    "a base as a list": Mistake(
        *("[0, 0, 0]", "robot 'a': base", "give a Pose, such as Pose(xyz=(0, 0, 0)"),
        with_arm(base=[0, 0, 0]),
    ),
    "a pose as a tuple": Mistake(
        *("(0, 0, 1)", "object 't': pose", "give a Pose, such as"),
        with_part(CUBE, "t", pose=(0, 0, 1)),
    ),
    "stopping as a number": Mistake(
        *("is 5.0", "robot 'a': stopping", "such as {'deceleration': 5.0}"),
        with_arm(stopping=5.0),
    ),
    "numbers without joints": Mistake(
        *("[5, 5, 5]", "deceleration", "it must be a number, or numbers by joint name"),
        with_arm(stopping={"deceleration": [5, 5, 5]}),
    ),
    "a misspelt figure": Mistake(
        *("'decelaration'", "figure", "did you mean 'deceleration'"),
        with_arm(stopping={"decelaration": 1}),
    ),
    "name and shape exchanged": Mistake(
        *("Box(", "the name", "it must be text, as in add(Box(size="),
        with_part("t", CUBE),
    ),
    "no shape": Mistake(
        *("1.0 is no shape", "object 't'", "give shapes such as"),
        with_part([1.0], "t"),
    ),
    "a quaternion that is not unit": Mistake(
        *("norm 0.5", "quat_wxyz", "it must be 1"),
        lambda *_: Pose(quat_wxyz=(0.5, 0, 0, 0)),
    ),
    "two numbers of three": Mistake(
        *("(0.0, 0.0)", "xyz", "it must be 3 finite numbers"),
        lambda *_: Pose(xyz=(0, 0)),
    ),
    "another robot": Mistake(
        *("'fr3'", "robot", "or one of the named robots: baxter"),
        lambda scene, _: scene.add_robot("fr3", "a"),
    ),
    "another mode": Mistake(
        *("'pth'", "mode", "one of fixed, speed, path"), alone(mode="pth")
    ),
    "two robots at one place": Mistake(
        *("coincide", "bases of 'a' and 'b'", "give one a `base`"), at_one_place
    ),
}

REST = np.zeros(4)


def step(q=None, stamp=0.02, **given):
    """A cycle of an arm at rest with one input changed, after one that is right."""

    def play(guard):
        home = guard.home
        given.setdefault("velocity", REST)
        guard.step(home, 0.0, velocity=REST, now=given.get("now") and 0.0)
        return guard.step(home if q is None else q, stamp, **given).why

    return play


def first(q):
    """The first cycle of arms at rest at a position."""
    return lambda guard: guard.step(q, 0.0, velocity=REST).why


def desired(motion, form="filter"):
    """One cycle of a desired motion."""

    def play(guard):
        return getattr(guard, form)(guard.home, motion, 0.0, velocity=REST).why

    return play


def driven(motion, form="filter", cycles=80):
    """Cycles of arms that follow a desired motion, from a middle position."""

    def play(guard):
        q, v = np.array([0.5, 0.2, 0.5, 0.2]), REST
        for k in range(cycles):
            v = getattr(guard, form)(q, motion, 0.02 * k, velocity=v).velocity
            q = np.clip(q + 0.02 * v, guard.tables.lower, guard.tables.upper)
        return ""

    return play


WRONG_HOME = [0.5, 0.1, 0.5]

# A function plays cycles of a guard; the answer is the verdict's `why`, what the call
# raises, or what it logs.
CYCLES = {
    "degrees": Mistake(
        *("is at 45.0000", "joint 'a/turn'", "give radians"), first([45, 0.1, 45, 0.1])
    ),
    "degrees of a hypothetical position": Mistake(
        *("is at 45.0000", "joint 'a/turn'", "give radians"),
        lambda guard: guard.judge_at_rest([45, 0.1, 45, 0.1]).why,
    ),
    "millimetres": Mistake(
        *("is at 100.0000", "joint 'a/lift'", "give metres"),
        first([0.5, 100, 0.5, 100]),
    ),
    "degrees a second": Mistake(
        *("at 30.00 a second", "joint 'a/turn'", "check its unit, rad/s"),
        step(velocity=[30, 0, 0, 0]),
    ),
    "NaN": Mistake(
        *("is at nan", "joint 'a/lift'", "it must be finite; check the sensor"),
        step([0.5, np.nan, 0.5, 0.1]),
    ),
    "joints in reverse order": Mistake(
        *("is at 0.5000", "joint 'a/lift'", "reverse order; see guard.q_names"),
        first([0.1, 0.5, 0.1, 0.5]),
    ),
    "too few positions": Mistake(
        *("shape (3,)", "q has", "it must be 4 numbers in the order of guard.q_names"),
        step(WRONG_HOME),
    ),
    "text for positions": Mistake(
        *("a str", "q is", "it must be 4 numbers"), step("abc")
    ),
    "positions that jump": Mistake(
        *("at 25.00 a second", "joint 'a/turn'", "check units, joint order"),
        step([1.0, 0.1, 0.5, 0.1]),
    ),
    "stamps in milliseconds": Mistake(
        *("20000.0 ms", "since the last cycle", "if stamps are in milliseconds, give"),
        step(stamp=20.0),
    ),
    "a slower loop than declared": Mistake(
        *("40.0 ms", "but the scene declares period 20.0 ms", "set Scene(period=0.04)"),
        step(stamp=0.04),
    ),
    "a stamp that goes back": Mistake(
        *("by 500.0 ms", "a stamp is older", "check the clocks"), step(stamp=-0.5)
    ),
    "a stamp that stays": Mistake(
        *("0.000000 s", "the time of the cycle", "check the clock"), step(stamp=0.0)
    ),
    "two clocks": Mistake(
        *("1699999999980.0 ms", "'a'", "of the same clock"),
        step(stamp=1.7e9, now=0.02),
    ),
    "an old measurement": Mistake(
        *("(900.0 ms)", "'a'", "check sensor, network"), step(stamp=0.0, now=0.9)
    ),
    "no stamp": Mistake(
        *("no finite stamp", "'a'", "pass the time of the measurement"),
        step(stamp=None),
    ),
    "text for a stamp": Mistake(
        *("'now'", "stamp is", "they must be numbers [s]"), step(stamp="now")
    ),
    "a stamp of another robot": Mistake(
        *("'c'", "a stamp for", "known names are 'a', 'b'"), step(stamp={"c": 0.02})
    ),
    "desired degrees": Mistake(
        *("is 45", "q_desired of joint 'a/turn'", "give radians"),
        driven([45, 0.1, 45, 0.1], "filter_positions", 2),
        logged=True,
    ),
    "desired millimetres": Mistake(
        *("is 100", "q_desired of joint 'b/lift'", "give metres"),
        driven({"a": [0.5, 0.1], "b": [0.5, 100]}, "filter_positions", 2),
        logged=True,
    ),
    "desired degrees a second": Mistake(
        *("is 45 rad/s", "v_desired of joint 'a/turn'", "give rad/s: 0.7854"),
        driven([45, 0, 0, 0]),
        logged=True,
    ),
    "desired millimetres a second": Mistake(
        *("is 200 m/s", "v_desired of joint 'b/lift'", "give m/s: 0.2"),
        driven({"b/lift": 200}),
        logged=True,
    ),
    "a twist in millimetres a second": Mistake(
        *("is 150 m/s", "the twist of robot 'a'", "give m/s: 0.15"),
        driven({"a": [0, 0, 150, 0, 0, 0]}, "filter_twists"),
        logged=True,
    ),
    "a twist in degrees a second": Mistake(
        *("is 45 rad/s", "the twist of robot 'b'", "give rad/s: 0.7854"),
        driven({"b": [0, 0, 0, 0, 0, 45]}, "filter_twists"),
        logged=True,
    ),
    "a desired NaN": Mistake(
        *("is nan", "v_desired of 'b/turn'", "it must be finite"),
        desired([0, 0, np.nan, 0]),
    ),
    "too few desired velocities": Mistake(
        *(
            "shape (3,)",
            "v_desired has",
            "it must be 4 numbers in the order of guard.q",
        ),
        desired([0, 0, 0]),
    ),
    "a desired joint that is not there": Mistake(
        *("'a/trun'", "v_desired names", "known names are 'a', 'b', 'a/turn'"),
        desired({"a/trun": 0.1}),
    ),
    "a desired robot that is not there": Mistake(
        *("'panda'", "v_desired names", "known names are 'a', 'b'"),
        desired({"panda": [0, 0]}),
    ),
    "a robot without a desired position": Mistake(
        *("no vector", "q_desired has", "of robot 'b'"),
        desired({"a": [0.5, 0.1]}, "filter_positions"),
    ),
    "five numbers of a twist": Mistake(
        *("shape (5,)", "the twist of 'a'", "it must be 6 numbers in the order of vx"),
        desired({"a": [0] * 5}, "filter_twists"),
    ),
    "a twist of another tool": Mistake(
        *("'hand'", "there is a twist for", "known names are 'a', 'b', 'a/base'"),
        desired({"hand": [0] * 6}, "filter_twists"),
    ),
    "degrees of a retreat": Mistake(
        *("go to 45.0000", "joint 'a/turn'", "give radians"),
        lambda guard: guard.retreat("a", to=[45, 0.1]),
    ),
    "another robot to engage": Mistake(
        *("'panda'", "no robot is named", "known names are 'a', 'b'"),
        lambda guard: guard.engage("panda"),
    ),
    "millimetres of a contact": Mistake(
        *("is 2 m", "'a/tip' may touch 'ball': depth", "give metres: 0.002"),
        lambda guard: guard.allow("a/tip", "ball", depth=2),
    ),
    "millimetres of an obstacle": Mistake(
        *("800 m", "object 'ball': pose", "give metres: 0.8"),
        lambda guard: guard.place("ball", Pose(xyz=(800, 0, 0))),
        logged=True,
    ),
    "an obstacle that is not there": Mistake(
        *("'bal'", "no fixed object is named", "did you mean 'ball'?"),
        lambda guard: guard.place("bal", Pose()),
    ),
    "a path of too few joints": Mistake(
        *("shape (1, 3)", "a path", "rows of 4 finite positions"),
        lambda guard: guard.check_path([WRONG_HOME]),
    ),
}
