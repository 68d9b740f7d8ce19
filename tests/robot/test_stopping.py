"""Figures of a robot, its measured stops, and how far it goes on."""

from math import inf, nan, radians

import numpy as np
import pytest

from armguard.errors import ModelError
from armguard.robot.fitting import fit_robot
from armguard.robot.kinematics import forward_kinematics, kinematic_table
from armguard.robot.limits import joint_limits
from armguard.robot.named import ROBOTS, find_named_robot
from armguard.robot.stopping import (
    FiguresError,
    StoppingFigures,
    StopTable,
    TableFile,
    declared_figures,
    named_figures,
    read_stop_tables,
    stop_travel,
    stopping_figures,
)
from armguard.robot.stopping.declared import ASSUMPTION
from armguard.robot.stopping.figures import KEYS
from armguard.robot.stopping.link_stops import levers, spheres_around, stop_distances
from armguard.robot.urdf import load_urdf
from armguard.scene.bay import FOLDER
from arms import simple_arm

ARM = simple_arm()
BAY_ARM = FOLDER / "bay_arm.urdf"
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
def test_a_figure_that_cannot_be_true_is_named_in_words(case):
    declared, says = WRONG[case]
    with pytest.raises(FiguresError) as caught:
        declared_figures(ARM, declared)
    assert says in str(caught.value)


def test_assumptions_are_reported_where_nothing_else_is_declared():
    figures = declared_figures(ARM, LEAST)
    assert figures.joints == ARM.q_names
    assert "deceleration" not in figures.sources
    assert "velocity" not in figures.sources
    for key in set(KEYS) - {*LEAST, "tables", "sources"}:
        assert figures.sources[key].startswith(ASSUMPTION), key
    assert figures.acceleration.tolist() == [8.0] * 3


def test_figures_with_a_table_of_no_joint_cannot_be_made():
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
    assert (figures.deceleration_most >= 2.0 * figures.deceleration).all()
    assert (figures.acceleration >= figures.deceleration).all()
    for joint, top in zip(model.q_names, figures.velocity, strict=True):
        limit = model.joints[joint].velocity
        assert top >= limit - 1e-9 or limit >= 5.0, joint


# Stopping time [s] and distance [rad] of base, shoulder and elbow, from the manuals.
PUBLISHED = {
    "ur3": ((0.159, 0.18), (0.154, 0.20), (0.092, 0.15)),
    "ur5": ((0.244, 0.31), (0.530, 0.70), (0.164, 0.22)),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_figures_of_a_robot_by_name_take_no_less_than_was_measured(name):
    figures = named_figures(name, named(name))
    speed = radians(183.0)
    for k, (time, travel) in enumerate(PUBLISHED[name]):
        least = figures.brake_deceleration[k]
        assert speed / least >= time - 1e-12
        assert speed**2 / (2.0 * least) >= travel - 1e-12
        # And one of both is what was measured.
        assert least == pytest.approx(min(speed / time, speed**2 / (2.0 * travel)))


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
        table_time, table_travel = table.at(v)
        assert table_time >= time(v) - 1e-12
        assert table_travel >= travel(v) - 1e-12
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
def test_a_wrong_file_is_named_with_its_line(case, tmp_path):
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


FULL = {
    "velocity": {"joint1": 2.0, "joint2": 1.0, "joint3": 1.5},
    "acceleration": 12.0,
    "deceleration": {"joint1": 4.0, "joint2": 3.0, "joint3": 20.0},
    "ramp": 0.1,
    "settle": 0.01,
    "settle_time": 0.2,
    "sensing": 0.004,
    "command": 0.006,
}


def simulated(figures, j, speed, period, late, step=1e-5):
    """Way and time of a stop, by small steps: another road to the same figures."""
    reaction = figures.sensing + period + late + figures.command
    v, way, time = speed, 0.0, 0.0
    while time < reaction - 1e-12:
        dt = min(step, reaction - time)
        faster = max(v, min(figures.velocity[j], v + figures.acceleration[j] * dt))
        way, time, v = way + (v + faster) / 2.0 * dt, time + dt, faster
    braked, top = 0.0, v
    while v > 0.0:
        middle = braked + step / 2.0
        share = min(1.0, middle / figures.ramp) if figures.ramp else 1.0
        slower = max(0.0, v - figures.deceleration[j] * share * step)
        way, v, braked = way + (v + slower) / 2.0 * step, slower, braked + step
    way += figures.settle[j] * top / figures.velocity[j]
    return way, time + braked + figures.settle_time


@pytest.mark.parametrize("joint", range(3))
@pytest.mark.parametrize("speed", [0.0, 0.05, 0.4, 0.97, 1.5, 2.5])
@pytest.mark.parametrize("ramp", [0.0, 0.02, 0.1, 0.8])
def test_a_stop_is_what_small_steps_make_of_it(joint, speed, ramp):
    figures = declared_figures(ARM, {**FULL, "ramp": ramp})
    stop = stop_travel(figures, joint, speed, period=0.008, late=0.002)
    way, time = simulated(figures, joint, speed, 0.008, 0.002)
    assert stop.travel == pytest.approx(way, abs=3e-5)
    assert stop.time == pytest.approx(time, abs=3e-5)
    assert stop.reaction_time == pytest.approx(0.020)


def test_no_motion_within_the_figures_goes_farther():
    """Any acceleration until the drives obey, any deceleration that is enough."""
    rng = np.random.default_rng(5)
    figures = declared_figures(ARM, FULL)
    for _ in range(60):
        j, speed = rng.integers(3), rng.uniform(0.0, 1.0)
        computed = stop_travel(figures, j, speed, period=0.008)
        step, v, way, reaction = 1e-4, speed, 0.0, rng.uniform(0.0, 0.018)
        for _ in range(int(reaction / step)):
            way += v * step
            v += rng.uniform(-1.0, 1.0) * figures.acceleration[j] * step
            v = min(v, figures.velocity[j])
        braked = 0.0
        while v > 0.0:
            share = min(1.0, braked / figures.ramp)
            v -= rng.uniform(1.0, 2.0) * share * figures.deceleration[j] * step
            way, braked = way + max(v, 0.0) * step, braked + step
        assert way <= computed.travel + 1e-3 * figures.velocity[j]


def test_a_stop_is_longer_the_faster_the_later_the_softer():
    figures = declared_figures(ARM, FULL)
    travels = [stop_travel(figures, 0, v, 0.008).travel for v in np.linspace(0, 2, 99)]
    assert (np.diff(travels) > 0.0).all()
    plain = stop_travel(figures, 0, 1.0, 0.008)
    assert stop_travel(figures, 0, -1.0, 0.008) == plain
    assert stop_travel(figures, 0, 1.0, 0.008, 0.01).travel > plain.travel
    softer = declared_figures(ARM, {**FULL, "deceleration": 3.0})
    assert stop_travel(softer, 0, 1.0, 0.008).travel > plain.travel
    assert plain.travel == plain.reaction + plain.braking + plain.settle


def test_a_table_takes_the_place_of_the_formula():
    table = StopTable((0.5, 2.0), (0.3, 0.5), (0.1, 0.7))
    figures = declared_figures(ARM, {**FULL, "tables": {"joint1": table}})
    stop = stop_travel(figures, 0, 1.0, 0.008)
    assert (stop.braking_time, stop.braking) == table.at(stop.speed)
    assert stop.speed == pytest.approx(1.0 + 12.0 * 0.018)
    assert stop.settle == stop.settle_time == 0.0
    assert stop_travel(figures, 1, 0.5, 0.008).settle > 0.0


def test_what_cannot_be_judged_is_reported():
    figures = declared_figures(ARM, FULL)
    assert np.isnan(stop_travel(figures, 0, nan, 0.008).travel)
    for period, late in ((-0.001, 0.0), (nan, 0.0), (0.001, -0.001)):
        with pytest.raises(FiguresError, match="both must be >= 0"):
            stop_travel(figures, 0, 1.0, period, late)


def poses_of(model, q):
    table = kinematic_table(model)
    T = np.zeros((len(table.parent), 12))
    forward_kinematics(
        q,
        table.parent,
        table.joint_kind,
        table.q_index,
        table.gain,
        table.T_parent_joint,
        table.axis,
        T,
    )
    return table, T.reshape(-1, 3, 4)


@pytest.mark.parametrize("name", ["panda", "ur5", "bay"])
def test_no_point_of_a_link_moves_farther_than_travel_times_lever(name):
    rng = np.random.default_rng(3)
    model = load_urdf(BAY_ARM) if name == "bay" else named(name)
    fits = fit_robot(model)
    reach = levers(model, fits)
    lower, upper = (np.clip(x, -7.0, 7.0) for x in joint_limits(model))
    worst = {link: np.zeros(len(lower)) for link in fits}
    for k in range(600):
        q = rng.uniform(lower, upper)
        move = rng.uniform(-1.0, 1.0, len(q)) * 10.0 ** rng.uniform(-3.0, -0.5)
        if k % 2:
            # One joint alone, to see how much of the bound is used.
            move *= np.arange(len(q)) == (k // 2) % len(q)
        (table, before), (_, after) = poses_of(model, q), poses_of(model, q + move)
        for link, fit in fits.items():
            centres, radii = spheres_around(fit, table.T_body_link[link])
            out = rng.normal(size=centres.shape)
            out *= (radii / np.linalg.norm(out, axis=1))[:, None]
            points = np.c_[centres + out, np.ones(len(centres))].T
            body = table.body_of_link[link]
            step = (after[body] - before[body]) @ points
            moved = np.linalg.norm(step, axis=0).max()
            bound = float(np.abs(move) @ reach[link])
            assert moved <= bound + 1e-12
            if k % 2 and bound:
                worst[link] = np.maximum(worst[link], (move != 0.0) * moved / bound)
    # A bound, but no excuse: most of it is used, but where offsets cannot add up.
    used = np.concatenate([worst[link][reach[link] > 0.0] for link in fits])
    assert np.median(used) > 0.5


def test_a_planar_arms_stops_are_what_one_expects():
    figures = declared_figures(ARM, {**FULL, "settle": 0.0, "ramp": 0.0})
    stops = stop_distances(ARM, fit_robot(ARM), figures, period=0.008)
    assert [s.share for s in stops if s.link == "link1"] == [0.10, 0.33, 0.66, 1.0]
    (first,) = (s for s in stops if s.link == "link1" and s.share == 1.0)
    (last,) = (s for s in stops if s.link == "link3" and s.share == 1.0)
    # Links of 0.4 m with a radius of 40 mm, one above the other.
    travel = [
        stop_travel(figures, k, figures.velocity[k], 0.008).travel for k in range(3)
    ]
    assert first.distance == pytest.approx(0.44 * travel[0])
    assert last.distance >= 1.24 * travel[0] + 0.84 * travel[1] + 0.44 * travel[2]
    assert last.distance <= 1.1 * (
        1.44 * travel[0] + 0.94 * travel[1] + 0.44 * travel[2]
    )
    assert last.distance == last.reaction + last.braking + last.settle
