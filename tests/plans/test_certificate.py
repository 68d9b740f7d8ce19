"""Certificates: confirmed as they are, and refused with one part missing or changed."""

from dataclasses import replace

import numpy as np
import pytest

import armguard as ag
from armguard.plans.certificate import Certificate, CertificateError
from armguard.plans.coal_world import CoalWorld
from armguard.plans.recheck import recheck
from tubes import arm_among_objects

TIMES = np.array([0.0, 0.5, 1.0, 1.5])


@pytest.fixture(scope="module")
def verifier():
    return ag.PlanVerifier(arm_among_objects())


@pytest.fixture(scope="module")
def plan(verifier):
    rng = np.random.default_rng(2)
    rows = rng.uniform(-0.6, 0.6, (4, 6))
    speeds = rng.uniform(-1.0, 1.0, (4, 6))
    names = verifier.scene.q_names
    motion = ag.Trajectory(names, rows, TIMES, "x", velocities=speeds)
    return ag.Plan.of(motion, verifier.scene)


@pytest.fixture(scope="module")
def made(verifier, plan):
    return verifier.certificate(plan)


def test_a_certificate_is_confirmed_and_says_what_it_leaves_open(verifier, made):
    found = recheck(made, verifier.checker.tables)
    free = made.leaves[:, 4] == 0.0
    assert found.leaves == free.sum() > 10
    assert found.open == (~free).sum() > 0
    assert found.tiles == len(made.tiles)


def test_a_file_has_the_same_certificate_and_one_changed_byte_is_seen(made, tmp_path):
    path = tmp_path / "plan.npz"
    made.write(path)
    assert Certificate.read(path).digest == made.digest
    with np.load(path) as held:
        arrays = dict(held)
    arrays["leaves"][3, 5] += 1e-9
    np.savez(path, **arrays)
    with pytest.raises(CertificateError, match="not those that were written"):
        Certificate.read(path)
    path.write_bytes(b"PK nothing")
    with pytest.raises(CertificateError):
        Certificate.read(path)


def test_each_leaf_that_is_missing_is_missed(verifier, made):
    tables = verifier.checker.tables
    for k in range(0, len(made.leaves), max(len(made.leaves) // 12, 1)):
        less = replace(made, leaves=np.delete(made.leaves, k, axis=0))
        with pytest.raises(CertificateError, match=r"a leaf of .* is missing"):
            recheck(less, tables)
    less = replace(made, tiles=np.delete(made.tiles, 5, axis=0))
    with pytest.raises(CertificateError, match="a tile of segment"):
        recheck(less, tables)


def changed(made, leaf, column, value):
    leaves = made.leaves.copy()
    leaves[leaf, column] = value
    return replace(made, leaves=leaves)


def test_one_changed_number_of_a_leaf_is_seen(verifier, made):
    tables = verifier.checker.tables
    near = int(np.flatnonzero(made.leaves[:, 4] == 1.0)[0])
    with pytest.raises(CertificateError, match=r"cannot be confirmed|bound of"):
        recheck(changed(made, near, 4, 0.0), tables)
    free = int(np.flatnonzero(made.leaves[:, 4] == 0.0)[0])
    bound = made.leaves[free, 5]
    for wrong in (bound + 0.5, -0.1):
        with pytest.raises(CertificateError, match="the bound of"):
            recheck(changed(made, free, 5, wrong), tables)
    later = made.leaves[free, 2] + 1e-6
    with pytest.raises(CertificateError, match="missing or changed"):
        recheck(changed(made, free, 2, later), tables)


def test_a_pair_that_is_not_left_open_any_more_is_not_confirmed(verifier, made):
    tables = verifier.checker.tables
    near = made.leaves[made.leaves[:, 4] == 1.0][0]
    pair = made.pairs[int(near[0])]
    inside = (
        (made.tiles[made.open[:, 0], 0] == near[1])
        & (made.tiles[made.open[:, 0], 1] <= near[2])
        & (made.tiles[made.open[:, 0], 2] >= near[3])
        & (made.open[:, 1:] == pair).all(axis=1)
    )
    assert inside.sum() == 1
    with pytest.raises(CertificateError, match="cannot be confirmed"):
        recheck(replace(made, open=made.open[~inside]), tables)


def test_curves_of_another_plan_are_not_confirmed(verifier, made):
    control = made.control.copy()
    control[1, 1:3, 0] += 1.5
    with pytest.raises(CertificateError, match=r"cannot be confirmed|the bound of"):
        recheck(replace(made, control=control), verifier.checker.tables)


def test_a_scene_that_changed_is_refused(made):
    scene = arm_among_objects(buffer=0.011)
    with pytest.raises(CertificateError, match="the scene has changed"):
        recheck(made, ag.PlanVerifier(scene).checker.tables)


def test_no_point_moves_farther_than_the_levers_of_the_recheck():
    tables = ag.Checker(ag.bay_scene()).tables
    world = CoalWorld(tables)
    rng = np.random.default_rng(1)
    moving = slice(tables.moving_count)
    for q in rng.uniform(tables.lower, tables.upper, (40, len(tables.lower))):
        step = rng.uniform(-0.01, 0.01, len(q))
        way = world.place(q + step)[moving] - world.place(q)[moving]
        most = world.levers[moving] @ np.abs(step)
        assert (np.linalg.norm(way, axis=1) <= most).all()
    assert world.levers[moving].max() < 3.0
