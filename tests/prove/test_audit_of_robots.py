"""A published SRDF audited, and the proofs judged by Pinocchio and Coal."""

import numpy as np
import pytest

from armguard.prove import Budget, prove_pairs
from armguard.robot.named import find_named_robot, robots_folder
from armguard.scene import Scene
from audit_pairs import MeshContact

# Configurations that Coal judges, all pairs together.
SAMPLES = 10_000

NEVER = [
    ("panda_link0", "panda_link4"),
    ("panda_hand", "panda_link3"),
    ("panda_hand", "panda_link6"),
    ("panda_link2", "panda_link4"),
    ("panda_leftfinger", "panda_link4"),
]


@pytest.fixture(scope="module")
def panda():
    return Scene(mode="fixed").add_robot("panda", name="panda")


@pytest.fixture(scope="module")
def judge(panda):
    folder = robots_folder().parent
    return MeshContact(
        find_named_robot("panda").urdf,
        [folder, folder.parent],
        panda.model,
        panda.home,
    )


def test_coal_finds_no_contact_in_what_is_proven_apart(
    panda, judge, tmp_path, monkeypatch
):
    monkeypatch.setattr("armguard.prove.store.cache_home", lambda: tmp_path)
    proofs = prove_pairs(panda, NEVER, budget=Budget(seconds=10.0))
    rng = np.random.default_rng(0)
    for proof in proofs:
        assert proof.verdict == "never"
        joints = [panda.model.joints[name] for name in panda.model.q_names]
        low, high = [j.lower for j in joints], [j.upper for j in joints]
        for q in rng.uniform(low, high, (SAMPLES // len(NEVER), len(joints))):
            positions = dict(zip(panda.model.q_names, q, strict=True))
            assert not judge.touch(proof.link_a, proof.link_b, positions)
        # Nor where it is nearest.
        assert not judge.touch(proof.link_a, proof.link_b, proof.nearest)


def test_coal_sees_the_contact_that_a_claim_denies(panda, judge, tmp_path, monkeypatch):
    monkeypatch.setattr("armguard.prove.store.cache_home", lambda: tmp_path)
    (proof,) = prove_pairs(
        panda, [("panda_leftfinger", "panda_rightfinger")], budget=Budget(seconds=10.0)
    )
    assert proof.verdict == "sometimes"
    assert proof.touching is not None
    assert proof.apart is not None
    assert judge.touch(proof.link_a, proof.link_b, proof.touching)
    assert not judge.touch(proof.link_a, proof.link_b, proof.apart)
