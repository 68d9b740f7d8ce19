"""Audits against MuJoCo's distances, and each kind of finding by its numbers."""

import numpy as np
import pytest

import armguard as ag
from armguard.fleet.audit import Auditor
from armguard.fleet.episodes import Frames
from armguard.fleet.inputs import Input
from armguard.fleet.job import JobModel
from armguard.scene import load_scene

mujoco = pytest.importorskip("mujoco")

MJCF = """<mujoco><worldbody>
 <geom name="base" type="sphere" size="0.05"/>
 <geom name="ball" type="sphere" size="0.1" pos="0.5 0.45 0"/>
 <body name="rod"><joint axis="0 0 1"/><geom name="rod" type="sphere" size="0.05"
   pos="0.3 0 0"/>
  <body name="tip" pos="0.3 0 0"><joint axis="0 0 1"/>
   <geom name="tip" type="sphere" size="0.05" pos="0.33 0 0"/></body></body>
</worldbody></mujoco>"""

# Pairs that the scene checks: neighbours in the arm are none.
PAIRS = [("rod", "ball"), ("tip", "ball"), ("base", "tip")]

FPS = 30.0


@pytest.fixture
def auditor(cell):
    return Auditor(load_scene(cell / "cell.yaml"), 1024, JobModel(inputs=["x"]))


def frames_of(*episodes, leaders=None, times=None):
    """Frames of episodes as a reader gives them."""
    counts = [len(q) for q in episodes]
    first = np.concatenate(([0], np.cumsum(counts)))
    stamps = np.concatenate([np.arange(n) / FPS for n in counts])
    return Frames(
        inputs=[Input("data", "dataset", k, n, 0, 0) for k, n in enumerate(counts)],
        first=first,
        q=np.concatenate(episodes),
        leader=None if leaders is None else np.concatenate(leaders),
        times=stamps if times is None else times,
        timed=True,
        late=np.zeros(len(counts)),
    )


def swings(count, seed):
    """Episodes in which both joints swing, smoothly and anywhere."""
    rng = np.random.default_rng(seed)
    t = np.arange(80) / FPS
    for k in range(count):
        size, rate = rng.uniform(0.3, 1.2, 2), rng.uniform(0.5, 1.5, 2)
        middle, phase = rng.uniform(-1.5, 1.5, 2), rng.uniform(0.0, 6.28, 2)
        if k % 3 == 0:
            # The arm bends back on itself.
            middle[1], size[1] = 2.5, 0.45
        yield middle + size * np.sin(rate * t[:, None] + phase)


def kinds(row):
    return [one["kind"] for one in row["findings"]]


def test_contacts_are_those_of_mujoco_between_frames_too(auditor):
    """At 40 places of each step MuJoCo's distances agree with the intervals."""
    episodes = [*swings(25, seed=1)]
    rows = [*auditor.audit(frames_of(*episodes))]
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)
    touching = clear = own = 0
    for q, row in zip(episodes, rows, strict=True):
        t = np.linspace(0.0, (len(q) - 1) / FPS, 40 * (len(q) - 1) + 1)
        dense = np.column_stack([np.interp(t * FPS, np.arange(len(q)), c) for c in q.T])
        least = np.inf
        for a, b in PAIRS:
            gap = np.empty(len(t))
            ends = [mujoco.mj_name2id(model, 5, name) for name in (a, b)]
            for k, place in enumerate(dense):
                data.qpos[:] = place
                mujoco.mj_kinematics(model, data)
                gap[k] = mujoco.mj_geomDistance(model, data, *ends, 10.0, None)
            least = min(least, gap.min())
            spans = [
                (one["start"], one["end"], one["kind"])
                for one in row["findings"]
                if {one["a"].split("/")[-1], one["b"].split("/")[-1]} == {a, b}
                and one["kind"] in ("contact", "self-contact", "too near")
            ]
            inside = np.zeros(len(t), dtype=bool)
            for start, end, kind in spans:
                within = (t >= start) & (t <= end)
                inside |= within
                # A narrow interval has no sample in it.
                lowest = gap[within].min(initial=0.02)
                assert lowest < 0.02 + 1e-3
                assert (lowest < -1e-4) <= (kind != "too near")
                own += kind == "self-contact"
                assert (kind == "self-contact") == (kind != "too near" and a == "base")
            assert not (gap[~inside] < 0.02).any()
        # That of a clear episode is measured at its frames.
        assert least - 1e-3 <= row["least"] <= least + 5e-3
        assert row["clear"] == (least >= 0.02)
        assert (row["contacts"] > 0) == (least < 0.0)
        touching += row["contacts"] > 0
        clear += row["clear"]
    assert touching > 3 and clear > 3 and own > 0


def test_a_contact_between_two_frames_is_found(auditor):
    """The tip is past the ball within one step; both frames are clear."""
    q = np.array([[0.0, 0.0], [1.6, 0.0]])
    checker = ag.Checker(auditor.scene)
    assert checker.clear(q).all()
    [row] = auditor.audit(frames_of(q))
    assert not row["clear"] and row["contacts"] == 1
    # The tip is 0.63 m from the axis, the ball 0.6727 m at 0.7328 rad.
    assert row["least"] == pytest.approx(0.6727 - 0.63 - 0.15, abs=1e-3)
    assert row["time"] == pytest.approx(0.7328 / 1.6 / FPS, abs=1e-3)


def test_joints_are_judged_by_their_numbers(auditor):
    t = np.arange(60) / FPS
    still, swing = np.full(60, -0.5), -1.0 + 0.3 * np.sin(t)
    beyond = np.column_stack((np.linspace(-2.9, -3.2, 60), still))
    jump = np.column_stack((swing, still.copy()))
    jump[30:, 1] += 0.4
    frozen = np.column_stack((np.linspace(-1.5, -0.5, 60), still))
    late = np.column_stack((swing, still + 1e-3 * np.sin(t)))
    rows = [*auditor.audit(frames_of(beyond, jump, frozen, late))]
    # The guard stops a joint beyond its limits.
    assert kinds(rows[0]) == ["limit", "frozen", "stop"]
    assert rows[0]["stop_reason"] == "OUT_OF_LIMITS"
    assert rows[0]["beyond_limits"] == 1
    assert rows[0]["findings"][0]["value"] == pytest.approx(0.2, abs=1e-5)
    assert "40 frames from frame 20" in rows[0]["findings"][0]["text"]
    assert kinds(rows[1]) == ["jump"]
    assert (rows[1]["jumps"], rows[1]["top_speed"]) == (1, pytest.approx(0.4 * 30 / 2))
    assert kinds(rows[2]) == ["frozen"] and rows[2]["frozen"] == 1
    assert kinds(rows[3]) == []
    assert rows[3]["clear"] and rows[3]["start_proven"]
    # Between two inputs nothing moves, also if one has a single frame.
    rows = [*auditor.audit(frames_of(frozen[:1], late, frozen[-1:], late))]
    assert [kinds(row) for row in rows] == [[], [], [], []]
    assert [row["frames"] for row in rows] == [1, 60, 1, 60]


def test_leader_and_follower_are_compared_at_rest_alone(auditor):
    """While they move the follower lags; at rest it is 0.07 rad off in one joint."""
    q = np.tile([-1.0, -0.5], (60, 1))
    q[20:40, 0] = np.linspace(-1.0, -0.4, 20)
    q[40:, 0] = -0.4
    q[0, 1] = -0.501
    leader = q + np.array([0.03, 0.07])
    leader[20:40, 0] += 0.5
    [row] = auditor.audit(frames_of(q, leaders=[leader]))
    assert kinds(row) == ["rest offset"]
    assert row["rest_offset"] == pytest.approx(0.07)
    assert row["findings"][0]["a"] == "arm/bend"
    # The first frame counts as no rest: of ten frames there are nine.
    for count, known in ((10, None), (11, pytest.approx(0.02))):
        rest = np.tile([-1.0, -0.5], (count, 1))
        [short] = auditor.audit(frames_of(rest, leaders=[rest + 0.02]))
        assert short["rest_offset"] == known
    # A leader that has no such joint compares nothing.
    [row] = auditor.audit(frames_of(q, leaders=[np.full_like(leader, np.nan)]))
    assert kinds(row) == [] and row["rest_offset"] is None


def test_a_start_behind_the_ball_is_not_reached_straight(auditor):
    q = np.tile([1.6, 0.0], (3, 1)) + np.linspace(0.0, 0.1, 3)[:, None]
    [row] = auditor.audit(frames_of(q))
    assert kinds(row) == ["start"] and not row["start_proven"]
    assert row["findings"][0]["b"] == "ball"
    # From -1 to 1.6 rad, until the tip is near the ball at about 0.48 rad.
    assert 0.5 < row["findings"][0]["value"] < 0.6


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e6])
def test_a_frame_without_numbers_is_not_clear_and_spoils_no_other(auditor, bad):
    good = np.column_stack((np.linspace(-1.0, -0.5, 40), np.linspace(0.0, 0.1, 40)))
    wrong = good.copy()
    wrong[7, 1] = bad
    rows = [*auditor.audit(frames_of(good, wrong, good))]
    assert [row["clear"] for row in rows] == [True, False, True]
    assert kinds(rows[1])[0] == "no number" and rows[1]["findings"][0]["value"] == 7
    assert "arm/bend" in rows[1]["findings"][0]["text"]
    assert rows[1]["stop"] is None


def test_times_that_do_not_rise_are_named(auditor):
    q = np.column_stack((np.linspace(-1.0, -0.5, 5), np.linspace(0.0, 0.1, 5)))
    times = np.array([0.0, 0.1, 0.1, 0.2, 0.3])
    [row] = auditor.audit(frames_of(q, times=times))
    assert "times" in kinds(row) and row["clear"]


def test_the_guard_stops_where_a_guard_does(auditor, cell):
    """The first frame nearer than the buffer, by the distance of two spheres."""
    q = np.column_stack((np.linspace(-0.5, 1.6, 60), np.full(60, 0.0)))
    back = q[:25]
    rows = [*auditor.audit(frames_of(q, back))]
    tip = 0.63 * np.column_stack((np.cos(q[:, 0]), np.sin(q[:, 0])))
    gap = np.hypot(*(tip - [0.5, 0.45]).T) - 0.15
    frame = int(np.argmax(gap < 0.02))
    assert rows[0]["stop"] == pytest.approx(frame / FPS)
    assert rows[0]["stop_reason"] == "TOO_CLOSE" and rows[0]["needless"] is False
    assert rows[1]["stop"] is None
