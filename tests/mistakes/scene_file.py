"""Mistakes in a scene file: a text is the file, the answer that of `armguard check`."""

from mistakes.mistake import Mistake


def scene_text(
    period="0.02", stopping="{deceleration: 1.0}", robot="", rest="", urdf="r.urdf"
):
    """A scene file of two arms with one line changed."""
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
