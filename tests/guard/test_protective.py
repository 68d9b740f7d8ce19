"""The protective separation distance: six terms that sum to what the guard keeps."""

import re

import numpy as np
import pytest

from approach import FIGURES, ball_guard, moving
from armguard.geometry import Pose
from armguard.respond import Guard
from armguard.scene import Scene
from arms import simple_arm

SPEED = 1.6
INTRUSION = 0.08


@pytest.fixture(scope="module")
def person():
    """A person who walks at 1.6 m/s and was seen at the first cycle."""
    guard = ball_guard(
        ball={"person": True, "top_speed": SPEED, "buffer": INTRUSION},
        settings={"margin": 2.0},
    )
    guard.place("ball", Pose(xyz=(0.5, 0.5, 0.2)), stamp=0.0)
    return guard


def terms_of(sentence):
    """Letters and millimetres of a sentence, and its total."""
    total, parts = sentence.split(" mm = ")
    found = re.findall(r"(\w_?\w?) (-?\d+\.\d)", parts)
    return float(total.removeprefix("S_p ")), {k: float(v) for k, v in found}


def test_of_a_person_the_six_terms_sum_to_what_the_guard_keeps(person):
    verdict = moving(person, 0.3, 1.0)
    kept = verdict.protective_distance
    assert (kept.robot, kept.other) == ("arm", "ball")
    assert kept.total == pytest.approx(verdict.budget.needed, abs=1e-12)
    assert kept.c == INTRUSION
    assert kept.z_d == 0.0
    assert kept.z_r == pytest.approx(verdict.budget.error, abs=1e-15)
    # Seen one cycle ago, and on the way until the arm rests: 0.25 s and more.
    assert kept.s_h > SPEED * 0.25
    total, terms = terms_of(kept.sentence)
    assert list(terms) == ["S_h", "S_r", "S_s", "C", "Z_d", "Z_r"]
    assert sum(terms.values()) == pytest.approx(total, abs=0.01)
    assert total == pytest.approx(kept.total * 1e3, abs=0.051)


def test_the_guard_keeps_it(person):
    verdict = moving(person, 0.3, 1.0)
    kept, pair = verdict.protective_distance, verdict.nearest
    assert pair.headroom == pytest.approx(pair.distance - kept.total, abs=1e-12)


def test_the_persons_way_grows_with_the_time_since_it_was_seen(person):
    fresh = moving(person, 0.3, 0.0).protective_distance
    old = moving(person, 0.3, 0.0, age=0.043).protective_distance
    # The cycle is 43 ms later; the arm's own measurement is 40 ms older than before.
    assert old.s_h - fresh.s_h >= SPEED * 0.043 - 1e-9


def test_it_is_none_where_no_person_is():
    guard = ball_guard()
    verdict = moving(guard, 0.1, 0.5)
    assert verdict.protective_distance is None
    kept = verdict.protective_distance_of(verdict.nearest)
    assert kept.s_h == 0.0
    assert kept.total == pytest.approx(verdict.budget.needed, abs=1e-12)
    assert moving(guard, 0.5, 0.0).protective_distance is None


def test_of_another_arm_its_own_reaction_and_stopping_take_the_persons_place():
    scene = Scene(mode="path", margin=1.5)
    for name, y in (("left", 0.7), ("right", -0.7)):
        turn = {"joint1": 0.0, "joint2": 0.0}
        scene.add_robot(
            simple_arm(joints=2, length=0.4),
            name=name,
            base=Pose(xyz=(0.0, y, 0.0)),
            stopping=FIGURES,
            home=turn,
        )
    guard = Guard(scene)
    guard.step(np.zeros(4), 0.0, velocity=np.zeros(4))
    v = np.array([-0.3, 0.0, 0.5, 0.0])
    verdict = guard.step(v * 1e-3, 1e-3, velocity=v)
    pair = verdict.nearest
    kept = verdict.protective_distance_of(pair)
    assert {kept.robot, kept.other} == {"left", "right"}
    assert kept.s_h == pytest.approx(
        verdict.budget.reaction_b + verdict.budget.stopping_b, abs=1e-15
    )
    assert kept.s_h > 0.01
    assert kept.total == pytest.approx(verdict.budget.needed, abs=1e-12)
    others = [p for p in verdict.near if p.primitive_a != pair.primitive_a]
    assert all(verdict.protective_distance_of(p) is None for p in others)


def test_it_is_part_of_the_verdict_as_numbers(person):
    reported = moving(person, 0.3, 1.0).to_dict()["protective_distance"]
    letters = ("s_h", "s_r", "s_s", "c", "z_d", "z_r")
    assert sum(reported[x] for x in letters) == pytest.approx(
        reported["total"], abs=1e-12
    )
