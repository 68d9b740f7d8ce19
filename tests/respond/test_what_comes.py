"""Which objects come at a robot, and how long they take to pass."""

import numpy as np
import pytest

from armguard.guard.clusters import Cluster
from armguard.guard.watch import Given
from armguard.guard.workspace import Settings
from armguard.index.octree_state import ABSENT, INDEXED, Residency
from armguard.kernel import kernel
from armguard.motion.figures import RobotFigures
from armguard.record import records
from armguard.respond.approaching import BEHIND, BESIDE, FORESIGHT, look_for_approaching
from armguard.respond.escape_state import Approaching, EscapePlan
from armguard.respond.state import Behaviour
from records import record

# Two boxes of the robot, one of another robot, and an object.
BOXES = np.array(
    [
        [-0.2, -0.1, 0.0, 0.1, 0.1, 0.3],
        [0.0, -0.3, 0.1, 0.4, 0.0, 0.2],
        [5.0, 5.0, 5.0, 6.0, 6.0, 6.0],
        [0.0, 0.0, 0.0, 0.1, 0.1, 0.1],
    ]
)

# What both of the robot are within.
LOW, HIGH = np.array([-0.2, -0.3, 0.0]), np.array([0.4, 0.1, 0.3])

TIME, AGE = 0.4, 0.07


@kernel(entry=True)
def look(a, e, w, v, m):
    look_for_approaching(0, a, e, w, v, m)


def found(centre, velocity, half=0.05, present=True, as_cluster=False):
    """Whether an object or a cluster comes, and when it has passed [s]."""
    boxes = BOXES.copy()
    boxes[3] = np.concatenate([np.array(centre) - half, np.array(centre) + half])
    residency = records(4, Residency)
    residency.status = INDEXED
    residency[3].status = INDEXED if present else ABSENT
    settings, given = records(1, Behaviour), records(1, Given)[0]
    settings[0].evade_time, given.now = TIME, 5.0
    clusters = records(1 if as_cluster else 0, Cluster)
    clusters["low"], clusters["high"] = boxes[3, :3], boxes[3, 3:]
    clusters["velocity"], clusters["stamp"] = velocity, 5.0 - AGE
    loop_settings = records(1, Settings)[0]
    loop_settings.moving_count = 3
    e = record(
        reach=np.zeros(6),
        own=np.zeros(4, dtype=np.int32),
        approaching=records(16, Approaching),
        plan=records(1, EscapePlan)[0],
    )
    w = record(
        settings=loop_settings,
        world=record(
            boxes=boxes, rows=np.zeros((4, 16)), kinds=np.zeros(4, dtype=np.int32)
        ),
        groups=np.zeros(4, dtype=np.int32),
        sensed=record(slots=np.full((4, 2), 3, dtype=np.int32)),
        octree=record(residency=residency),
    )
    v = record(
        robot_of=np.array([0, 0, 1], dtype=np.int32),
        movers=np.array([] if as_cluster else [3], dtype=np.int32),
        clusters=clusters,
        cluster_evaded=np.zeros(len(clusters), dtype=np.int64),
        object_velocity=np.array([[0.0, 0, 0]] * 3 + [velocity], dtype=float),
        seen_at=np.full(4, 5.0 - AGE),
        given=given,
        stamps=np.array([5.0]),
    )
    m = record(robot_figures=records(1, RobotFigures))
    look(record(settings=settings), e, w, v, m)
    assert e.plan.own_count == 2
    assert e.reach == pytest.approx(np.concatenate([LOW, HIGH]))
    comes = e.plan.approaching_count == 1
    assert v.cluster_evaded.tolist() == [int(comes)] * len(clusters)
    return comes, e.plan.horizon


def comes(centre, velocity, half=0.05):
    """The same on a grid of times: whether it gets beside the robot's box soon."""
    start = np.array(centre) + AGE * np.array(velocity)
    ends = start, start + FORESIGHT * TIME * np.array(velocity)
    low = np.minimum(*ends) - half - BESIDE
    high = np.maximum(*ends) + half + BESIDE
    return bool((low < HIGH).all() and (high > LOW).all())


def passed(centre, velocity, half=0.05):
    """When it is as far behind as is required, by the corner that leaves last."""
    speed = np.linalg.norm(velocity)
    ahead = np.array(velocity) / speed
    start = np.array(centre) + AGE * np.array(velocity)
    corners = np.where(ahead > 0.0, HIGH - (start - half), LOW - (start + half))
    return (ahead @ corners + BEHIND) / speed


@pytest.mark.parametrize("as_cluster", [False, True])
def test_what_gets_beside_a_robot_soon_comes_and_is_watched_until_it_has_passed(
    as_cluster,
):
    rng = np.random.default_rng(1)
    counted = 0
    for _ in range(300):
        centre, velocity = rng.uniform(-1.5, 1.5, 3), rng.normal(size=3)
        does, horizon = found(centre, velocity, as_cluster=as_cluster)
        assert does == comes(centre, velocity)
        if does:
            known = min(max(passed(centre, velocity), 0.0), 8.0)
            assert horizon == pytest.approx(known)
        counted += does
    assert 20 < counted < 280


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_what_is_just_far_enough_aside_does_not_come(axis, sign):
    other = (axis + 1) % 3
    velocity = np.zeros(3)
    velocity[axis] = sign
    for side, edge in ((-1.0, LOW), (1.0, HIGH)):
        for beyond, known in ((-1e-6, True), (1e-6, False)):
            centre = 0.5 * (LOW + HIGH)
            centre[axis] = 0.0
            centre[other] = edge[other] + side * (0.05 + BESIDE + beyond)
            assert found(centre, velocity)[0] == known


def test_what_is_slow_or_not_there_does_not_come():
    at = (0.1, 0.0, 0.1)
    assert not found(at, (0.0099, 0.0, 0.0))[0]
    assert found(at, (0.0101, 0.0, 0.0))[0]
    assert not found(at, (1.0, 0.0, 0.0), present=False)[0]
