"""Figures of a robot, its measured stops, and how far it goes on."""

from math import inf, nan, radians

import numpy as np
import pytest

from armguard.errors import ModelError
from armguard.robot.named import ROBOTS, find_named_robot
from armguard.robot.stopping import (
    FiguresError,
    StoppingFigures,
    StopTable,
    TableFile,
    declared_figures,
    named_figures,
    read_stop_tables,
    stopping_figures,
)
from armguard.robot.stopping.declared import ASSUMPTION, KEYS
from armguard.robot.urdf import load_urdf
from arms import simple_arm

ARM = simple_arm()
LEAST = {"velocity": 1.0, "deceleration": 4.0}


def named(name):
    robot = find_named_robot(name)
    return load_urdf(robot.urdf, srdf=robot.srdf)


WRONG = {
    "missing": ({"velocity": 1.0}, "deceleration is missing: the least deceleration"),
    "unknown": ({**LEAST, "decelaration": 1.0}, "did you mean 'deceleration'"),
    "no speed": (
        {"deceleration": 4.0},
        "joint 'joint1' has no speed limit in the URDF",
    ),
    "zero": ({**LEAST, "deceleration": 0.0}, "is 0; it must be finite and > 0"),
    "negative": ({**LEAST, "deceleration": -1.0}, "is -1; it must be finite and > 0"),
    "nan": ({**LEAST, "deceleration": nan}, "is nan; it must be finite and > 0"),
    "infinite": ({**LEAST, "velocity": inf}, "is inf; it must be finite and > 0"),
    "one joint": (
        {**LEAST, "deceleration": {"joint1": 4.0}},
        "deceleration is missing for joint 'joint2'",
    ),
    "no joint": (
        {**LEAST, "settle": {"jiont1": 0.0, "joint2": 0.0, "joint3": 0.0}},
        "settle is given for 'jiont1', no joint; did you mean 'joint1'",
    ),
    "delay": ({**LEAST, "sensing": -0.001}, "sensing is -0.001; it must be finite"),
    "delay nan": ({**LEAST, "command": nan}, "command is nan; it must be finite"),
    "stale": ({**LEAST, "stale": 0.001}, "every measurement would be refused"),
    "most": ({**LEAST, "deceleration_most": 3.0}, "is 3, below its deceleration, 4"),
    "most nan": ({**LEAST, "deceleration_most": nan}, "is nan, below its"),
    "degrees": ({**LEAST, "velocity": 180.0}, "is 180, which looks like degrees"),
    "degrees, stop": (
        {**LEAST, "deceleration": 600.0},
        "is 600, which looks like degrees; give radians",
    ),
    "turned base": ({**LEAST, "base_turn": 2.0}, "which looks like degrees"),
    "milliseconds": (
        {**LEAST, "sensing": 2.0, "stale": 2.0},
        "looks like milliseconds",
    ),
    "millimetres": ({**LEAST, "base_error": 2.0}, "which looks like millimetres"),
    "table of nobody": (
        {**LEAST, "tables": {"jont": [[1.0, 0.3, 0.2]]}},
        "there is a stopping table for 'jont', no joint",
    ),
    "table too far": (
        {**LEAST, "tables": {"joint1": [[1.0, 0.3, 0.4]]}},
        "joint 'joint1': a joint that starts to stop at 1 cannot get 0.4 far in 0.3 s",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_figure_that_cannot_be_true_is_told_in_words(case):
    declared, says = WRONG[case]
    with pytest.raises(FiguresError) as caught:
        declared_figures(ARM, declared)
    assert says in str(caught.value)


def test_who_declares_nothing_else_is_told_what_is_assumed():
    figures = declared_figures(ARM, LEAST)
    assert figures.joints == ARM.q_names
    assert "deceleration" not in figures.sources
    assert "velocity" not in figures.sources
    for key in set(KEYS) - {*LEAST, "tables", "sources"}:
        assert figures.sources[key].startswith(ASSUMPTION), key
    assert figures.acceleration.tolist() == [8.0] * 3


def test_figures_with_a_table_of_nobody_cannot_be_made():
    figures = stopping_figures(ARM, **LEAST)
    values = {key: getattr(figures, key) for key in StoppingFigures.__slots__}
    table = StopTable((1.0,), (0.3,), (0.2,))
    with pytest.raises(FiguresError, match="for 'elbow', no joint"):
        StoppingFigures(**{**values, "tables": {"elbow": table}})
    with_table = StoppingFigures(**{**values, "tables": {"joint2": table}})
    assert with_table.table_of(1) is table
    assert with_table.table_of(0) is None


def test_declared_figures_come_before_a_robots_own():
    own = stopping_figures(
        ARM,
        **LEAST,
        deceleration_most=8.0,
        ramp=0.01,
        tables={"joint1": StopTable((1.0,), (0.3,), (0.2,))},
        sources={"ramp": "a manual", "deceleration": "a manual"},
    )
    beside = declared_figures(ARM, {"base_error": 0.002}, own)
    assert (beside.base_error, beside.ramp) == (0.002, 0.01)
    assert beside.sources["ramp"] == beside.sources["deceleration"] == "a manual"
    assert "base_error" not in beside.sources
    assert list(beside.tables) == ["joint1"]
    other = declared_figures(ARM, {"deceleration": 10.0}, own)
    assert other.deceleration.tolist() == [10.0] * 3
    assert other.deceleration_most.tolist() == [inf] * 3
    assert not other.tables
    assert other.sources["deceleration_most"].startswith(ASSUMPTION)


@pytest.mark.parametrize("name", ROBOTS)
def test_every_named_robot_has_figures_and_each_a_source(name):
    model = named(name)
    figures = named_figures(name, model)
    assert figures is not None
    for key in StoppingFigures.__slots__:
        if key not in ("tables", "sources", "joints"):
            assert len(figures.sources[key]) > 10, key
    assert (figures.deceleration_most == 2.0 * figures.deceleration).all()
    assert (figures.acceleration >= figures.deceleration).all()
    for joint, top in zip(model.q_names, figures.velocity, strict=True):
        limit = model.joints[joint].velocity
        assert top >= limit - 1e-9 or limit >= 5.0, joint


def test_the_figures_of_the_ur5_take_no_less_than_was_measured():
    figures = named_figures("ur5", named("ur5"))
    speed = radians(183.0)
    for k, (time, travel) in enumerate(((0.244, 0.31), (0.530, 0.70), (0.164, 0.22))):
        least = figures.brake_deceleration[k]
        assert speed / least >= time - 1e-12
        assert speed**2 / (2.0 * least) >= travel - 1e-12


def test_a_table_answers_between_below_and_beyond_its_speeds():
    table = StopTable((1.0, 2.0), (0.3, 0.4), (0.2, 0.6))
    assert table.at(1.0) == (0.3, 0.2)
    assert table.at(2.0) == (0.4, 0.6)
    assert table.at(1.5) == pytest.approx((0.4, 0.4))
    assert table.at(0.5) == pytest.approx((0.3, 0.1))
    assert table.at(4.0) == pytest.approx((0.8, 2.4))
    assert table.at(0.0) == (0.0, 0.0)
    assert np.isnan(table.at(nan)).all()


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.2])
def test_a_table_never_promises_less_than_what_it_was_measured_on(delay):
    """A delay and a constant deceleration, sampled at three speeds."""
    least, speeds = 3.0, (0.66, 1.32, 2.0)
    time = lambda v: delay + v / least  # noqa: E731
    travel = lambda v: delay * v + v**2 / (2.0 * least)  # noqa: E731
    table = StopTable(speeds, tuple(map(time, speeds)), tuple(map(travel, speeds)))
    for v in np.linspace(0.01, 3.0, 300):
        told_time, told_travel = table.at(v)
        assert told_time >= time(v) - 1e-12
        assert told_travel >= travel(v) - 1e-12
    assert table.deceleration <= least


CSV = """joint,speed_percent,load_percent,extension_percent,time_ms,angle_deg
joint1,50,33,100,200,3.0
joint1,50,66,100,260,3.5
joint1,100,33,100,300,8.0
joint1,100,66,33,320,9.0
joint1,100,66,100,350,10.0
joint1,100,100,100,500,12.0
joint2,100,66,100,400,11.0
joint2,50,66,100,450,4.0
"""


def read(tmp_path, text=CSV, **conditions):
    path = tmp_path / "stop.csv"
    path.write_text(text)
    file = TableFile(path=path, **conditions)
    return read_stop_tables(file, ARM, dict.fromkeys(ARM.q_names, 1.0))


def test_a_file_of_measured_stops_is_reduced_to_its_worst(tmp_path):
    tables = read(tmp_path)
    assert list(tables) == ["joint1", "joint2"]
    assert tables["joint1"].speeds == (0.5, 1.0)
    assert tables["joint1"].times == pytest.approx((0.260, 0.500))
    assert tables["joint1"].travels == pytest.approx((radians(3.5), radians(12.0)))
    # A higher speed that was measured to need less time counts for no less.
    assert tables["joint2"].times == pytest.approx((0.450, 0.450))


@pytest.mark.parametrize(
    ("conditions", "times"),
    [
        ({"load": 66.0, "extension": 100.0}, (0.260, 0.350)),
        ({"load": 66.0, "extension": 20.0}, (0.260, 0.320)),
        ({"load": 33.0}, (0.200, 0.300)),
        ({"load": 10.0}, (0.200, 0.300)),
        ({"load": 50.0}, (0.260, 0.350)),
    ],
)
def test_the_rows_of_the_next_condition_count(tmp_path, conditions, times):
    text = "\n".join(line for line in CSV.splitlines() if "joint2" not in line)
    table = read(tmp_path, text, **conditions)["joint1"]
    assert table.times == pytest.approx(times)


def test_speeds_may_be_speeds_and_travels_metres(tmp_path):
    panda = named("panda")
    path = tmp_path / "s.csv"
    path.write_text("joint,speed,time_s,travel_m\npanda_finger_joint1,0.1,0.2,0.01\n")
    (table,) = read_stop_tables(TableFile(path=path), panda, {}).values()
    assert table == StopTable((0.1,), (0.2,), (0.01,))


WRONG_FILES = {
    "unknown column": (CSV.replace("time_ms", "time_mss"), ":1: there is no column"),
    "two times": (
        "joint,speed,time_s,time_ms,angle_rad\n",
        ":1: needs one column of time_s, time_ms; has time_s and time_ms",
    ),
    "no travel": ("joint,speed,time_s\n", "angle_rad, angle_deg, travel_m; has none"),
    "empty": ("joint,speed,time_s,angle_rad\n", "stop.csv: has no rows"),
    "no number": (CSV.replace("8.0", "x"), ":4: angle_deg is 'x', no number"),
    "short row": (CSV + "joint2,50\n", ":10: speed_percent is"),
    "nan": (CSV.replace("8.0", "nan"), ":4: angle_deg is nan; it must be >= 0"),
    "negative": (CSV.replace("300", "-300"), ":4: time_ms is -300.0; it must be"),
    "zero": (CSV.replace("300", "0"), ":4: speed, time and way of a stop must be > 0"),
    "joint": (
        CSV.replace("joint2", "jont2"),
        ":8: no joint is named 'jont2'; did you mean 'joint2'",
    ),
    "too far": (CSV.replace("8.0", "80.0"), ":4: joint 'joint1' starts to stop at 1"),
    "metres of a turn": (
        "joint,speed,time_s,travel_m\njoint1,1,0.3,0.2\n",
        "'joint1' turns; its way is in angle_rad or angle_deg, not in travel_m",
    ),
}


@pytest.mark.parametrize("case", WRONG_FILES)
def test_a_wrong_file_is_told_with_its_line(case, tmp_path):
    text, says = WRONG_FILES[case]
    with pytest.raises(FiguresError) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith("stop.csv")
    if "short" not in case:
        assert says in str(caught.value)


def test_conditions_beyond_what_was_measured_are_refused(tmp_path):
    with pytest.raises(FiguresError, match="at a load_percent of 120 or more"):
        read(tmp_path, load=120.0)
    text = "joint,speed,time_s,angle_rad\njoint1,1,0.3,0.2\n"
    with pytest.raises(FiguresError, match="no column load_percent, yet a load"):
        read(tmp_path, text, load=50.0)
    with pytest.raises(FiguresError, match="cannot be read: No such file"):
        declared_figures(ARM, {**LEAST, "tables": tmp_path / "none.csv"})


def test_joints_with_tables_need_no_deceleration(tmp_path):
    path = tmp_path / "stop.csv"
    path.write_text(CSV)
    with pytest.raises(FiguresError, match="joint 'joint3' has no deceleration and no"):
        declared_figures(ARM, {"velocity": 1.0, "tables": path})
    figures = declared_figures(
        ARM, {"velocity": 1.0, "tables": path, "deceleration": {"joint3": 5.0}}
    )
    assert figures.deceleration[2] == 5.0
    assert figures.deceleration[0] == figures.tables["joint1"].deceleration
    assert figures.deceleration[0] <= 1.0 / 0.5


@pytest.mark.parametrize(
    "columns",
    [
        ((), (), ()),
        ((1.0,), (0.3, 0.4), (0.2,)),
        ((nan,), (0.3,), (0.2,)),
        ((1.0, 1.0), (0.3, 0.3), (0.2, 0.2)),
        ((1.0, 2.0), (0.3, 0.2), (0.2, 0.3)),
    ],
)
def test_a_table_that_cannot_be_true_is_refused(columns):
    with pytest.raises(ModelError):
        StopTable(*columns)
