"""`armguard coordinate`: jobs of two robots, with and without a service."""

import json
import re
import time
from itertools import product
from threading import Event

import numpy as np
import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

import armguard as ag
from armguard.cli.app import app
from armguard.cli.line_hands import (
    LONGEST_WAY,
    PAUSE,
    SLOW,
    LineHands,
    LineStart,
)
from armguard.cli.line_input import STALE, LineInput
from armguard.maps.cell_plan import CoordinationError
from armguard.maps.job import job_of, read_line_job
from armguard.maps.line_cell import Job
from armguard.maps.line_run import MOST_WAITING, LineRun
from armguard.plans.verify import PlanVerifier
from armguard.respond.command import Blocked
from armguard.scene.conveyor import conveyor_job_path, conveyor_path
from armguard.scene.yaml_source import SceneFileError

SCENE = """
mode: fixed
buffer: 0.02
robots:
  left: {urdf: arm.urdf, base: {xyz: [0, 0.35, 0]}, home: {turn: 0.7}}
  right: {urdf: arm.urdf, base: {xyz: [0, -0.35, 0]}, home: {turn: -0.7}}
"""
ARM = """<robot name="r"><link name="base"/>
 <link name="rod"><collision><origin xyz="0.5 0 0"/>
  <geometry><sphere radius="0.08"/></geometry></collision></link>
 <joint name="turn" type="revolute"><parent link="base"/><child link="rod"/>
  <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="2"/></joint>
</robot>"""
ROWS = {
    "left": "t,left/turn\n0,0.7\n1,-0.2\n2,-0.6\n4,0.7\n",
    "right": "t,right/turn\n0,-0.7\n1,0.2\n2,0.6\n4,-0.7\n",
}
ERROR = 0.01

# Time between two commands [s].
DT = 0.02

# Of the bundled cell: where items arrive along the belt, how high they are gripped, and
# the middle of the tray [m].
BEGIN, LOW, TRAY = -1.6, 0.12, (-0.32, 0.0)
JOB = {
    "scene": "cell.yaml",
    "plans": {
        "fetch": {"robot": "left", "file": "left.csv", "following_error": ERROR},
        "carry": {"robot": "right", "file": "right.csv"},
    },
    "jobs": [
        {"t": 0, "plans": ["fetch"]},
        {"t": 0.2, "plans": ["carry"]},
        {"t": 0.5, "plans": ["fetch"]},
    ],
}


# Of robots that are a cycle behind.
LATE = {name: {**one, "skew": 0.05} for name, one in JOB["plans"].items()}


def with_alternatives(count):
    """The plans, one of them with alternatives."""
    return {**JOB["plans"], "fetch": {**JOB["plans"]["fetch"], "alternatives": count}}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM)
    (tmp_path / "cell.yaml").write_text(SCENE)
    for robot, rows in ROWS.items():
        (tmp_path / f"{robot}.csv").write_text(rows)
    return tmp_path


def written(folder, **changed):
    """A job file: that above, some of it changed."""
    file = folder / "job.yaml"
    YAML().dump({**JOB, **changed}, file)
    return file


def test_jobs_are_done_and_their_motion_is_proven_clear(folder):
    motion = folder / "motion.csv"
    job = written(folder)
    answer = CliRunner().invoke(app, ["coordinate", str(job), "--motion", str(motion)])
    assert answer.exit_code == 0, answer.output
    *events, last = answer.stdout.splitlines()
    assert all(re.match(r" *\d+\.\d\d s  ", line) for line in events)
    assert any("yields to" in line for line in events)
    assert re.fullmatch(r"3 of 3 jobs done in \d+\.\d s", last)
    scene = ag.load_scene(folder / "cell.yaml")
    proof = PlanVerifier(scene).verify(ag.Plan.read(motion, scene))
    assert proof.clear
    # Plans of the same jobs at the same times, each as if it were alone, are not.
    rows = np.loadtxt(motion, delimiter=",", skiprows=1)
    left, right = (
        np.loadtxt(folder / f"{name}.csv", delimiter=",", skiprows=1) for name in ROWS
    )
    times = rows[rows[:, 0] <= 4.0, 0]
    alone = np.column_stack(
        (
            np.interp(times, *left.T),
            np.interp(times - 0.2, *right.T),
        )
    )
    crash = ag.Trajectory(scene.q_names, alone, times, "alone")
    assert not PlanVerifier(scene).verify(ag.Plan.of(crash, scene)).clear


def test_the_motion_of_the_bundled_job_is_proven(tmp_path):
    motion = tmp_path / "motion.csv"
    words = ["coordinate", str(conveyor_job_path()), "--motion", str(motion)]
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 0, answer.output
    assert "4 of 4 jobs done" in answer.stdout
    words = ["verify", str(motion), "--scene", str(conveyor_path())]
    assert CliRunner().invoke(app, words).exit_code == 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--belt"], "need a --port"),
        (["--recover"], "need a --port"),
        (["--jobs"], "need a --port"),
        (["--motion", "m.csv", "--port", "1"], "--motion goes without"),
        (["--port", "1", "--engage"], "--engage needs --recover"),
    ],
)
def test_options_that_do_not_go_together_are_refused(folder, options, words):
    answer = CliRunner().invoke(app, ["coordinate", str(written(folder)), *options])
    assert answer.exit_code == 2
    assert words in answer.output


def test_the_answer_as_json(folder):
    answer = CliRunner().invoke(app, ["coordinate", str(written(folder)), "--json"])
    found = json.loads(answer.stdout)
    assert found["done"] == [1, 2, 3] and found["missed"] == []
    assert found["jobs"] == 3 and found["fault"] == "" and found["seconds"] > 8.0


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"jobs": [{"t": 0, "plans": ["fetsh"]}]}, "did you mean 'fetch'"),
        ({"jobs": []}, "jobs: has none; give one, or read them on line with --jobs"),
        ({"jobs": [{"t": float("nan"), "plans": ["fetch"]}]}, "jobs"),
        (
            {"plans": {**JOB["plans"], "fetch": {"robot": "lefd", "file": "left.csv"}}},
            "did you mean 'left'",
        ),
        (
            {"conveyor": {"slowest": 0.1, "fastest": 0.2, "speed": 0.3}},
            "must be from 'slowest' to 'fastest'",
        ),
        ({"belt": 1}, "there is no such key"),
        ({"plans": with_alternatives(5)}, "alternatives"),
    ],
)
def test_a_wrong_job_is_named_with_its_line(folder, changed, words):
    with pytest.raises(SceneFileError) as refused:
        read_line_job(written(folder, **changed))
    assert words in str(refused.value)
    assert re.match(r"job\.yaml:\d+: ", str(refused.value))


def test_alternatives_of_a_robot_that_is_not_redundant_are_refused(folder):
    job = written(folder, plans=with_alternatives(1))
    answer = CliRunner().invoke(app, ["coordinate", str(job)])
    assert answer.exit_code != 0
    with pytest.raises(CoordinationError, match="use a robot whose tool is moved by 7"):
        read_line_job(job)


@pytest.mark.parametrize(("share", "stops"), [(0.99, False), (1.01, True)])
def test_robots_stop_where_one_is_farther_from_its_plan_than_declared(
    folder, share, stops
):
    job = read_line_job(written(folder))
    run = LineRun(job)
    for k in range(50):
        run.step(0.01 * k)
    q, _ = run.line.motion()
    q[0] += share * ERROR
    desired = run.velocities(q)
    assert bool(run.line.fault) == stops
    if stops:
        assert run.line.fault.startswith("left/turn is 0.010 rad")
    else:
        assert desired[0] < run.line.motion()[1][0]


def test_a_position_that_is_no_number_stops_both(folder):
    run = LineRun(read_line_job(written(folder)))
    run.step(0.0)
    q, _ = run.line.motion()
    q[1] = np.nan
    run.velocities(q)
    assert "right/turn" in run.line.fault
    now = 0.0
    while run.step(now) and now < 5.0:
        now += 0.01
    assert run.line.rests and now < 5.0


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["1.0 0.2\n", "one 0.2\n"], "'one 0.2' is no travel and speed"),
        (["1.0\n"], "'1.0' is no travel and speed"),
        (["1.0 0.2\n"], "the belt was not measured for 0.1 s"),
    ],
)
def test_a_belt_that_is_not_measured_any_more_stops_both(folder, lines, words):
    belt = {"slowest": 0.1, "fastest": 0.3, "speed": 0.2}
    job = read_line_job(written(folder, conveyor=belt))
    goes, wait = Event(), Event()

    def measurements():
        yield lines[0] if len(lines) > 1 else "0.0 0.2\n"
        goes.set()
        wait.wait(10.0)
        yield lines[-1]

    reads = LineInput(measurements(), belt=True, jobs=False)
    hands = LineHands(job, reads, says=unheard)
    run = hands.run
    assert goes.wait(10.0)
    q, _ = run.line.motion()
    hands.drive(0.0, q, {})
    assert hands.moves and not run.line.fault
    wait.set()
    time.sleep(2 * STALE)
    for k in range(1, 200):
        q, _ = run.line.motion()
        hands.drive(0.02 * k, q, {})
    assert words in run.line.fault
    assert run.line.rests and not hands.moves


@pytest.fixture
def three(folder):
    """A cell job of three robots, each two of which meet."""
    third = "  third: {urdf: arm.urdf, base: {xyz: [0.85, 0, 0], rpy: [0, 0, 3.1416]},"
    scene = f"{SCENE}{third} home: {{turn: -1.6}}}}\n"
    (folder / "three.yaml").write_text(scene)
    rows = "t,third/turn\n0,-1.6\n1,-1.6\n3,1.3\n5,-1.6\n6,-1.6\n"
    (folder / "third.csv").write_text(rows)
    plans = {**LATE, "turn": {"robot": "third", "file": "third.csv", "skew": 0.05}}
    names = ("turn", "fetch", "carry", "turn", "carry", "fetch")
    jobs = [{"t": 0.3 * k, "plans": [name]} for k, name in enumerate(names)]
    return written(folder, scene="three.yaml", plans=plans, jobs=jobs)


def test_three_robots_do_their_jobs_and_their_motion_is_proven_clear(folder, three):
    motion = folder / "motion.csv"
    words = ["coordinate", str(three), "--motion", str(motion)]
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 0, answer.output
    # Each diagram is counted once: of three pairs of robots, with a plan each.
    counts = re.findall(r"diagram of '.*' and '.*', (\d) of (\d)", answer.output)
    assert counts == [("1", "3"), ("2", "3"), ("3", "3")]
    assert "6 of 6 jobs done" in answer.stdout
    scene = ag.load_scene(folder / "three.yaml")
    assert PlanVerifier(scene).verify(ag.Plan.read(motion, scene)).clear


def test_the_state_of_three_robots_names_that_which_passes_first(three):
    hands = LineHands(read_line_job(three), None, says=unheard)
    line, seen = hands.run.line, set()
    for k in range(1200):
        hands.drive(DT * k, line.motion()[0], {})
        state = hands.state()
        assert [one["name"] for one in state["robots"]] == ["left", "right", "third"]
        for lane, one in zip(line.lanes, state["robots"], strict=True):
            first = re.search(r"yields: (\w+) passes first", one["does"])
            assert (first[1] if first else "") == lane.yields_to
            seen.add((lane.robot, lane.yields_to))
    assert len(line.finished) == 6 and not line.fault
    assert {robot for robot, other in seen if other} >= {"right", "third"}


BELT = {"slowest": 0.1, "fastest": 0.3, "speed": 0.2}


def lined_up(folder, lines, *, belt=False, **changed):
    """Hands that read lines, all of which are there, and positions of both robots."""
    job = read_line_job(written(folder, plans=LATE, **changed), more=True)
    reads = LineInput(lines, belt=belt, jobs=True)
    for _ in range(1000):
        if reads._closed:
            break
        time.sleep(0.01)
    said = []
    hands = LineHands(job, reads, says=lambda now, sentence: said.append(sentence))
    return hands, hands.run.line.motion()[0], said


def test_jobs_are_read_besides_those_of_the_file_and_wrong_lines_are_refused(folder):
    lines = [
        '{"plans": ["carry"]}\n',
        "\n",
        '{"plans": ["carri"]}\n',
        '{"plans": ["carry"], "ofset": 1}\n',
        '{"plans": ["carry"], "offset": NaN}\n',
        '{"plans": []}\n',
        "carry\n",
        '{"plans": ["fetch"], "offset": 0.5}\n',
    ]
    hands, q, said = lined_up(folder, lines, jobs=JOB["jobs"][:1])
    driven(hands, q, 16.0)
    assert not hands.moves and not hands.run.line.fault
    # One of the file, and the two that are right.
    assert hands.run.summary()["done"] == [1, 2, 3]
    assert hands.run.summary()["jobs"] == 3
    refused = [one for one in said if one.startswith("refused: ")]
    words = (
        "'carri' is no plan; did you mean 'carry'",
        "there is no such key; did you mean 'offset'",
        "offset: is nan; it must be finite",
        "plans: needs at least 1",
        "'carry': is no JSON",
    )
    assert len(refused) == len(words)
    assert all(word in one for word, one in zip(words, refused, strict=True))


def test_the_coordination_ends_with_its_input_and_not_before(folder):
    goes = Event()

    def lines():
        yield '{"plans": ["carry"]}\n'
        goes.wait(10.0)
        yield '{"plans": ["fetch"]}\n'

    job = read_line_job(written(folder, plans=LATE, jobs=[]), more=True)
    hands = LineHands(job, LineInput(lines(), belt=False, jobs=True), says=unheard)
    time.sleep(0.1)
    q, _ = driven(hands, hands.run.line.motion()[0], 6.0)
    assert hands.moves and hands.run.line.idle
    goes.set()
    time.sleep(0.1)
    driven(hands, q, 6.0, 6.0)
    assert not hands.moves and hands.run.summary()["done"] == [1, 2]


@pytest.mark.parametrize("wrong", ["0.1", "fetch", "[0.1, 0.2]"])
def test_belt_and_jobs_share_a_line_each_and_a_wrong_measurement_stops_all(
    folder, wrong
):
    lines = ["0.3 0.2\n", '{"plans": ["carry"]}\n']
    hands, q, said = lined_up(folder, lines, belt=True, conveyor=BELT, jobs=[])
    hands.drive(0.0, q, {})
    assert said == ["right begins job 1, carry"]
    assert hands.run.line.lanes[1].job.travel == 0.3
    hands, q, _ = lined_up(
        folder, [*lines, f"{wrong}\n"], belt=True, conveyor=BELT, jobs=[]
    )
    hands.drive(0.0, q, {})
    time.sleep(2 * STALE)
    hands.drive(DT, q, {})
    fault = f"'{wrong}' is no travel and speed of the belt"
    assert hands.run.line.fault.startswith(fault)


def test_jobs_that_come_faster_than_they_are_done_are_refused(folder):
    run = LineRun(read_line_job(written(folder, jobs=[]), more=True))
    for _ in range(MOST_WAITING):
        run.add(job_of('{"plans": ["fetch"]}'), 0.0)
    with pytest.raises(CoordinationError, match="50 jobs wait already; send more"):
        run.add(job_of('{"plans": ["fetch"]}'), 0.0)


def test_robots_that_the_guard_holds_stop_both(folder):
    # Robots here are a cycle behind.
    plans = {name: {**one, "skew": 0.05} for name, one in JOB["plans"].items()}
    hands = LineHands(read_line_job(written(folder, plans=plans)), None, says=unheard)
    run = hands.run
    q, _ = run.line.motion()
    # Before the start robots wait for velocities of zero.
    desired, _ = hands.drive(0.0, q, {"left": Blocked.STOPPED})
    assert not desired.any() and hands.moves and not run.line.fault
    for k in range(1, 40):
        hands.drive(0.02 * k, run.line.motion()[0], {"left": Blocked.NOT})
    assert not run.line.rests
    hands.drive(0.8, run.line.motion()[0], {"left": Blocked.STOPPED})
    assert run.line.fault.startswith("the guard holds left: stopped")


def unheard(now, sentence):
    """A decision that is not printed."""


def hands_of(folder, *, off=(0.0, 0.0), **how):
    """Hands of a job, and positions of both robots, off where plans begin."""
    plans = {name: {**one, "skew": 0.05} for name, one in JOB["plans"].items()}
    job = read_line_job(written(folder, plans=plans))
    hands = LineHands(job, None, says=unheard, **how)
    return hands, hands.run.line.motion()[0] + np.array(off)


def driven(hands, q, seconds, start=0.0, blocked=None):
    """Positions of robots that do what they are commanded, and the fastest of that."""
    fastest = 0.0
    for k in range(round(seconds / DT)):
        desired, engaged = hands.drive(start + DT * k, q, blocked or {})
        assert not engaged
        q = q + DT * desired
        if hands.now == 0.0:
            fastest = max(fastest, np.abs(desired).max())
    return q, fastest


def test_a_robot_that_is_not_where_its_plans_begin_is_named_with_a_remedy(folder):
    hands, q = hands_of(folder, off=(0.3, 0.0))
    for k in range(3):
        desired, _ = hands.drive(DT * k, q, {})
        assert not desired.any()
    fault = hands.run.line.fault
    assert fault.startswith("left/turn is 0.300 rad or m from where its plans begin")
    assert "drive it there" in fault and "--recover" in fault and not hands.moves


def test_robots_are_led_slowly_to_where_their_plans_begin_and_then_do_their_jobs(
    folder,
):
    hands, q = hands_of(folder, off=(0.3, -0.4), recovers=True)
    home = hands.run.line.motion()[0]
    q, fastest = driven(hands, q, 1.0)
    assert (
        hands.state()["robots"][0]["does"] == "is led slowly to where its plans begin"
    )
    assert fastest == SLOW and np.abs(q - home).max() < 0.2
    # While the guard holds one nothing moves, however long that takes.
    held = {"left": Blocked.STOPPED}
    still, _ = driven(hands, q, LONGEST_WAY + 1.0, 1.0, held)
    assert (still == q).all() and not hands.run.line.fault
    driven(hands, q, 16.0, 2.0 + LONGEST_WAY)
    assert hands.run.summary()["done"] == [1, 2, 3]


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_robot_whose_position_is_no_number_is_not_led(folder, wrong):
    hands, q = hands_of(folder, off=(0.0, wrong), recovers=True)
    desired, _ = hands.drive(0.0, q, {})
    assert not desired.any() and not hands.moves
    assert hands.run.line.fault.startswith("right/turn is")


def test_a_robot_that_does_not_get_to_where_its_plans_begin_is_given_up(folder):
    hands, q = hands_of(folder, off=(0.3, 0.0), recovers=True)
    for k in range(round((LONGEST_WAY + 1.0) / DT)):
        hands.drive(DT * k, q, {})
    assert "has not come there in 60 s; drive it there" in hands.run.line.fault
    assert not hands.moves


def test_after_a_stop_robots_go_back_and_later_jobs_are_done(folder):
    said = []
    hands, q = hands_of(folder, recovers=True)
    hands._says = lambda now, sentence: said.append(sentence)
    q, _ = driven(hands, q, 6.0)
    # Two jobs are done, the third one runs.
    assert set(hands.run.line.finished) == {1, 2}
    q, _ = driven(hands, q, 0.5, 6.0, {"left": Blocked.STOPPED})
    assert hands.run.line.fault.startswith("the guard holds left")
    q, _ = driven(hands, q, 7.0 + PAUSE, 6.5)
    assert not hands.run.line.fault and hands.run.line.rests
    assert [sentence for sentence in said if "jobs go on" in sentence]
    assert hands.state()["missed"] == 1
    hands.run.line.add(Job(4, ("carry",)))
    driven(hands, q, 5.0, 13.5 + PAUSE)
    found = hands.run.summary()
    assert found["done"] == [1, 2, 4] and found["missed"] == [3]
    assert hands.state()["done"] == 3


def test_without_recovery_a_stop_is_for_good(folder):
    hands, q = hands_of(folder)
    assert not hands.engages
    q, _ = driven(hands, q, 1.0)
    q, _ = driven(hands, q, 3.0, 1.0, {"right": Blocked.STOPPED})
    assert hands.run.line.fault and not hands.moves


@pytest.fixture(scope="module")
def busy(tmp_path_factory):
    """The bundled cell with a plan of each arm, and two items, for which they meet."""
    path = conveyor_job_path()
    job = YAML(typ="safe").load(path)
    job["scene"] = str(conveyor_path())
    plans = ["left late", "right early"]
    job["plans"] = {name: job["plans"][name] for name in plans}
    for plan in job["plans"].values():
        plan["file"] = str(path.parent / plan["file"])
    job["jobs"] = [{"t": t, "plans": plans} for t in (1.0, 7.0)]
    file = tmp_path_factory.mktemp("busy") / "job.yaml"
    YAML().dump(job, file)
    return read_line_job(file)


def test_robots_that_may_begin_are_not_off_a_plan_at_its_begin_or_its_end(busy):
    run = LineRun(busy)
    line, plans = run.line, busy.cell.plans
    home, accepted = line.motion()[0], 0
    start = LineStart(busy, home, leads=False)
    for joint, off in product(range(len(home)), (0.005, 0.02, 0.04, 0.06, 0.1)):
        q = home.copy()
        q[joint] += off
        try:
            start.way(0.0, q, held=False)
        except CoordinationError:
            continue
        accepted += 1
        for lane, (name, one) in product(line.lanes, plans.items()):
            if one.robot == lane.robot:
                for lane.place in (0.0, one.plan.plan.duration):
                    lane.plan = name
                    run.velocities(q)
                    assert not line.fault
    assert accepted > len(home) / 2


def test_the_state_has_the_places_of_items_and_which_arm_yields_to_which(busy):
    hands = LineHands(busy, None, says=unheard)
    yields, seen = [], {}
    for k in range(1300):
        hands.drive(DT * k, hands.run.line.motion()[0], {})
        state = hands.state()
        json.dumps(state, allow_nan=False)
        for item in state["items"]:
            number, (x, y, z) = item["job"], item["xyz"]
            arrived = busy.arrivals[number - 1].t
            assert z == pytest.approx(LOW, abs=5e-3)
            if item["moves"][1]:
                # Items arrive at the belt's beginning.
                begun = hands.now - arrived
                assert y == pytest.approx(BEGIN + 0.2 * begun, abs=0.2 * DT + 5e-3)
                assert x == pytest.approx(0.0, abs=5e-3)
                assert item["moves"] == pytest.approx([0.0, 0.2, 0.0], abs=2e-3)
            else:
                assert item["robot"] and np.hypot(x - TRAY[0], y - TRAY[1]) < 0.1
            seen.setdefault(number, set()).add((bool(item["robot"]), item["held"]))
        words = {robot["name"]: robot["does"] for robot in state["robots"]}
        yields += [words[r["name"]] for r in state["robots"] if r["yields"]]
        assert all(
            ("yields: " in words[r["name"]]) == r["yields"] for r in state["robots"]
        )
    # Each item waits, is an arm's, is held by it, and is put down.
    waits, own, held = (False, False), (True, False), (True, True)
    assert seen == {1: {waits, own, held}, 2: {waits, own, held}}
    sentences = {re.sub(r"[\d.]+ s", "1 s", one) for one in yields}
    first = "goes to item 2 – yields: left passes first"
    # No time is left while it gets faster again.
    assert sentences <= {first, f"{first}, 1 s more"}
    assert f"{first}, 1 s more" in sentences
    assert (state["done"], state["missed"], state["waiting"]) == (2, 0, 0)
    assert state["decisions"][-1][1] == "right has done job 2"
