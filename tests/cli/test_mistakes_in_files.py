"""Mistakes in files: the answer has the value, the place and the remedy.

Each kind in the scene file and in the motion file of `armguard run`. Mistakes in Python
are in tests/guard, messages to the service in tests/service.
"""

from math import inf, nan

import numpy as np
import pytest
from typer.testing import CliRunner

from armguard import ArmguardError
from armguard.cli.app import app
from arms import TURN_AND_LIFT

HOME = [0.5, 0.1, 0.5, 0.1]
HEADER = "t,a/turn,a/lift,b/turn,b/lift"
GIVE = "write one number a column, with a decimal point, separated as the header is"


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


def times(*stamps, name="t", moves=0.01):
    """A motion file with these times."""
    rows = (f"{t},{0.5 + moves * k},0.1,0.5,0.1" for k, t in enumerate(stamps))
    return "\n".join([name + HEADER[1:], *rows]) + "\n"


def table(*rows, header=HEADER):
    """A motion file of these rows."""
    return "\n".join([header, *rows]) + "\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the arm's file."""
    path = tmp_path_factory.mktemp("doors")
    (path / "r.urdf").write_text(TURN_AND_LIFT)
    (path / "good.yaml").write_text(scene_text())
    return path


def refusal(result):
    """What a command that failed has printed or raised."""
    assert result.exit_code != 0, result.output
    if result.exception and not isinstance(result.exception, SystemExit):
        assert isinstance(result.exception, ArmguardError), result.exception
        return str(result.exception)
    return " ".join(result.output.split())


FILES = {
    "NaN": (scene_text(robot="home: {turn: .nan}"), "a.home.turn: is nan; it must be"),
    "infinity": (scene_text(rest="buffer: .inf"), ":6: buffer: is inf; it must be fin"),
    "two numbers of three": (
        scene_text(robot="base: {xyz: [0, 0]}"),
        ":3: robots.a.base.xyz: expected 3 numbers, got 2",
    ),
    "four numbers of three": (
        scene_text(robot="base: {xyz: [0,5, 0, 0]}"),
        ":3: robots.a.base.xyz: expected 3 numbers, got 4",
    ),
    "text for a number": (
        scene_text(period="20ms"),
        ":1: cycle.period: expected a number, got '20ms'",
    ),
    "a rate": (
        scene_text().replace("period: 0.02", "rate: 50"),
        ":1: cycle.rate: there is no such key; give the period, {period: 0.02}",
    ),
    "unit beside a number": (
        scene_text(stopping="{deceleration: 5 rad/s2}"),
        "a.stopping.deceleration: expected a number, got '5 rad/s2'",
    ),
    "unknown joint": (
        scene_text(stopping="{deceleration: {turn: 1, lfit: 1}}"),
        "deceleration is given for 'lfit', no joint; did you mean 'lift'?",
    ),
    "missing joint": (
        scene_text(stopping="{deceleration: {turn: 1}}"),
        "deceleration is missing for joint 'lift'",
    ),
    "positions as a list": (
        scene_text(robot="home: [0.5, 0.1]"),
        ":3: robots.a.home: expected a mapping, got [0.5, 0.1]",
    ),
    "millimetres of a joint": (
        scene_text(robot="home: {lift: 100}"),
        ":3: robots.a: home puts joint 'lift' at 100, which looks like millimetres; "
        "give metres; its limits are [0, 0.4]",
    ),
    "degrees a second": (
        scene_text(stopping="{deceleration: 1, velocity: 180}"),
        "velocity of joint 'turn' is 180, which looks like degrees; give radians",
    ),
    "milliseconds of a delay": (
        scene_text(stopping="{deceleration: 1, delays: {sensing: 8}}"),
        "sensing is 8, which looks like milliseconds; give seconds",
    ),
    "millimetres of a grasp": (
        scene_text(rest="objects: {c: {sphere: {radius: 1}, graspable: {near: 100}}}"),
        ":6: objects.c.graspable.near: is 100 m, which looks like millimetres; give "
        "metres: 0.1",
    ),
    "a name twice": (
        scene_text().replace("  b: {", "  a: {"),
        ":4: the key 'a' is there twice; keep one",
    ),
    "no file": (scene_text(urdf="q.urdf"), "q.urdf' cannot be read: No such file"),
    "empty": ("", "must be a mapping with the key 'robots'"),
    "a list": ("- a\n", "must be a mapping with the key 'robots'"),
    "UTF-16": (scene_text().encode("utf-16"), "cannot be read: it is not UTF-8"),
}


@pytest.mark.parametrize("kind", FILES)
def test_a_scene_file_is_refused(folder, kind):
    text, says = FILES[kind]
    path = folder / "bad.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    said = refusal(CliRunner().invoke(app, ["check", str(path)]))
    assert says in said
    assert "-> fix " in said


MOTIONS = {
    "degrees": (
        table("0,0.5,0.1,0.5,0.1", "0.02,45,0.1,0.5,0.1"),
        "m.csv: configuration 2: joint 'a/turn' is at 45, which looks like degrees; "
        "give radians; its limits are [0.1, 2]",
    ),
    "millimetres": (
        table("0,0.5,100,0.5,100"),
        "configuration 1: joint 'a/lift' is at 100, which looks like millimetres; give",
    ),
    "milliseconds": (
        times(0, 20, 40),
        "m.csv: 20 s from one configuration to the next, and at most 0.05 % of a speed "
        "limit: that looks like milliseconds; name the times 't_ms', or 't_s'",
    ),
    "microseconds": (times(0, 2e4, 4e4), "20000 s from one configuration to the next"),
    "nanoseconds": (times(0, 2e7, 4e7), "nanoseconds; name the times 't_ns', or 't_s'"),
    "nanoseconds at rest": (times(0, 2e7, 4e7, moves=0), "name the times 't_ns', or"),
    "microseconds since 1970": (
        times(1.7e15, 1.7e15 + 2e4),
        "'t' begins with 1.7e+15, which is no time in seconds; name its unit: 't_ms'",
    ),
    "too short times": (
        times(0, 2e-5, 4e-5),
        "joint 'a/turn' would move at 500 times its speed limit: the times are too",
    ),
    "NaN": (
        table("0,0.5,nan,0.5,0.1"),
        "joint 'a/lift' is at nan: stop, it must be finite",
    ),
    "infinity": (
        table("0,0.5,inf,0.5,0.1"),
        "joint 'a/lift' is at inf: stop, it must be finite",
    ),
    "NaN time": (
        times(0, nan, 0.04),
        "the time of configuration 2 is nan; give a finite time, or delete the",
    ),
    "infinite time": (times(0, inf), "the time of configuration 2 is inf; give a fin"),
    "unsorted times": (
        times(0, 0.04, 0.02),
        "time goes from 0.04 s to 0.02 s at configuration 3; it must not go back: sort",
    ),
    "a time twice": (
        times(0, 0.02, 0.02, 0.04),
        "configurations 2 and 3 differ and both have the time 0.02 s; correct a time",
    ),
    "one time": (
        times(3, 3, 3, moves=0),
        "all 3 configurations have the time 3 s; correct the times, or leave them out",
    ),
    "two times": (
        table("0,0,0.5,0.1,0.5,0.1", header="time," + HEADER),
        "m.csv:1: columns 'time' and 't' are both times; delete one",
    ),
    "times without their name": (
        table("0,0.5,0.1,0.5,0.1", "1,0.5,0.1,0.5,0.1", header="z" + HEADER[1:]),
        "joint 'z' is not in the scene; known names are 'a/turn', 'a/lift', 'b/turn', "
        "'b/lift'; if it holds times, name it 't'",
    ),
    "reverse order": (
        table("0,0.5,0.1,0.5,0.1", header="t,b/lift,b/turn,a/lift,a/turn"),
        "joint 'a/lift' is at 0.5000: stop, its limits are [0.0000, 0.4000]; the "
        "joints seem to be in reverse order",
    ),
    "another joint": (
        table("0,0.5,0.1,0.5,0.1", header=HEADER.replace("a/lift", "a/lfit")),
        "joint 'a/lfit' is not in the scene; did you mean 'a/lift', 'b/lift'?",
    ),
    "another robot": (
        table("0,0.5,0.1,0.5,0.1", header=HEADER.replace("a/", "c/")),
        "joint 'c/turn' is not in the scene; no robot is 'c': known names are 'a', 'b'",
    ),
    "a joint of either robot": (
        table("0,0.5,0.1", header="t,turn,lift"),
        "joint 'turn' may be 'a/turn' or 'b/turn'; write the robot's name before it",
    ),
    "missing column": (
        table("0,0.5,0.1,0.5", header="t,a/turn,a/lift,b/turn"),
        "no positions for 'b/lift'; add columns, or hold them at home with --hold-home",
    ),
    "a column twice": (
        table("0,0.5,0.1,0.5,0.1", header=HEADER.replace("b/turn", "a/turn")),
        "m.csv:1: column 'a/turn' is there twice; delete one",
    ),
    "a joint by two names": (
        table("0,0.5,0.1,0.5,0.1", header=HEADER.replace("b/turn", "a_turn")),
        "joint 'a/turn' has two columns, 'a/turn' and 'a_turn'; delete one",
    ),
    "no header": ("0,0.5,0.1,0.5,0.1\n", "m.csv:1: the first line must hold the joint"),
    "empty": ("", "m.csv:1: the first line must hold the joint names"),
    "no row": (table(), "there is no configuration in it; give at least one"),
    "ragged": (
        table("0,0.5,0.1,0.5,0.1", "0.02,0.5,0.1"),
        f"m.csv:3: 3 columns; the header has 5; {GIVE}",
    ),
    "decimal commas": (
        table("0,0,5,0,1,0,5,0,1"),
        f"m.csv:2: 9 columns; the header has 5; {GIVE}",
    ),
    "a decimal comma in quotes": (
        table('0,"0,5",0.1,0.5,0.1'),
        f"m.csv:2: '0,5' is no number, in column 'a/turn'; {GIVE}",
    ),
    "another separator below": (
        table("0,0.5,0.1,0.5,0.1", header=HEADER.replace(",", ";")),
        f"m.csv:2: 1 columns; the header has 5; {GIVE}",
    ),
    "text": (
        table("0,half,0.1,0.5,0.1"),
        f"m.csv:2: 'half' is no number, in column 'a/turn'; {GIVE}",
    ),
    "an empty cell": (
        table("0,,0.1,0.5,0.1"),
        f"m.csv:2: '' is no number, in column 'a/turn'; {GIVE}",
    ),
    "a date": (
        table("2026-01-01T00:00:00,0.5,0.1,0.5,0.1"),
        f"m.csv:2: '2026-01-01T00:00:00' is no number, in column 't'; {GIVE}",
    ),
    "UTF-16": (
        times(0, 0.02).encode("utf-16"),
        "'m.csv' is no text in UTF-8; save it as CSV in UTF-8",
    ),
}


@pytest.mark.parametrize("kind", MOTIONS)
def test_a_motion_file_is_refused(folder, kind):
    text, says = MOTIONS[kind]
    path = folder / "m.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    words = ["run", str(folder / "good.yaml"), "--trajectory", str(path)]
    assert says in refusal(CliRunner().invoke(app, words))


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + times(0, 0.02),
        times(0, 20, name="t_ms"),
        times(0, 2e4, 4e4, name="t_us"),
        times(0, 0.02).replace(",", "|"),
        times(0, 1, 2, moves=0),
    ],
    ids=["BOM", "t_ms", "t_us", "bars", "slow and at rest"],
)
def test_a_motion_file_that_is_right_is_judged(folder, text):
    path = folder / "m.csv"
    path.write_text(text)
    words = ["run", str(folder / "good.yaml"), "--trajectory", str(path)]
    assert CliRunner().invoke(app, words).exit_code == 0


@pytest.mark.parametrize(
    ("name", "times", "says"),
    [
        ("t", [0.0, 20.0], "looks like milliseconds; name the times 't_ms', or 't_s'"),
        ("t_ms", [[0.0, 20.0]], "t_ms has shape (1, 2) of float64; it must be (2,) of"),
        ("time", ["0", "1"], "time has shape (2,) of <U1; it must be (2,) of numbers"),
        ("t_ms", [0.0, 20.0], None),
    ],
)
def test_times_of_arrays_are_as_those_of_tables(folder, name, times, says):
    path = folder / "m.npz"
    q = np.array([HOME, [0.51, *HOME[1:]]])
    np.savez(path, names=HEADER.split(",")[1:], q=q, **{name: np.array(times)})
    words = ["run", str(folder / "good.yaml"), "--trajectory", str(path)]
    result = CliRunner().invoke(app, words)
    if says is None:
        assert result.exit_code == 0, result.output
    else:
        assert says in refusal(result)
