"""Proofs that outlive a change of the commands say no more than proofs made anew."""

import numpy as np
import pytest

from armguard.motion.pair_proof import GAIN, LITTLE
from driven import ball_guard, two_arms, wall_guard
from speed.filter import crowded_guard

SCENES = {
    "ball": ball_guard,
    "wall": wall_guard,
    "two arms": two_arms,
    "crowded bay": lambda: crowded_guard(lambda sentence: None),
}


def led(guard, seed, cycles=400):
    """Commands and verdicts of a loop with desired motion that changes."""
    rng = np.random.default_rng(seed)
    q, v, found = guard.home, 0.0 * guard.home, []
    for k in range(cycles):
        if k % 40 == 0:
            desired = rng.uniform(-0.3, 0.3, len(q))
        command = guard.filter(q, desired, 1e-3 * k, velocity=v)
        found.append(command)
        v = command.velocity + rng.uniform(-0.005, 0.005, len(q)) * (k % 3 == 0)
        q = np.clip(q + 1e-3 * v, guard.tables.lower, guard.tables.upper)
    return found


@pytest.mark.parametrize("scene", SCENES)
def test_commands_are_the_same_to_the_bit(scene, monkeypatch):
    quick = led(SCENES[scene](), 4)
    # Without room for what pairs had left, all of them are judged anew.
    monkeypatch.setattr("armguard.guard.initial.JUDGED_ROOM", 0)
    anew = led(SCENES[scene](), 4)
    saved = 0
    for one, other in zip(quick, anew, strict=True):
        assert one.velocity.tobytes() == other.velocity.tobytes()
        assert one.action is other.action
        known = {(p.primitive_a, p.primitive_b): p for p in other.verdict.near}
        for pair in one.verdict.near:
            truth = known.get((pair.primitive_a, pair.primitive_b))
            if truth is not None:
                # What is left is known to GAIN, where that is little.
                most = truth.distance - truth.buffer
                if truth.headroom < LITTLE:
                    most = min(most, truth.headroom + GAIN)
                assert pair.headroom <= most
                saved += pair.headroom != truth.headroom
        for key, truth in known.items():
            reported = {(p.primitive_a, p.primitive_b) for p in one.verdict.near}
            assert key in reported or truth.headroom > 0.0
    if scene in ("ball", "crowded bay"):
        assert saved > 0
