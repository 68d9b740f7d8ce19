"""Permitted contacts and all others are listed apart."""

from pathlib import Path

import pytest

from armguard.guard.answer import names_of
from armguard.recording.calls import Allow
from armguard.recording.frames import frame_of
from armguard.recording.recorded import RecordedGuard
from armguard.recording.ring import RingReader, RingWriter
from armguard.report import gather, page
from armguard.respond import Guard
from grippers import Loop, guard_of, pick_scene
from gripping.gantry import BELOW, FINGER

# Where the hand is when the fingers' ends are 20 mm above the table [m].
ABOVE = BELOW + FINGER[2] + 0.02


class Taped(RecordedGuard):
    """A recorded guard that a loop of the tests can drive."""

    def __init__(self, guard: Guard, ring: RingWriter) -> None:
        super().__init__(guard, ring, monotonic=lambda: self.clock)
        self.home, self.q_names = guard.home, guard.q_names
        self.clock = 0.0

    def filter(self, q, v_desired, stamp, **options):
        self.clock = stamp
        return super().filter(q, v_desired, stamp, **options)


@pytest.fixture(scope="module")
def findings(tmp_path_factory: pytest.TempPathFactory):
    """Fingers go down to a table, are allowed to touch it, and do."""
    path: Path = tmp_path_factory.mktemp("contract") / "ring"
    guard = guard_of(pick_scene(blocks={}))
    taped = Taped(guard, RingWriter(path, 64 << 20))
    reader = RingReader(path)
    loop = Loop(taped)
    assert loop.go({"arm/z": ABOVE}, speed=0.3)
    for finger in ("left", "right"):
        taped.do(
            Allow(a=f"arm/{finger}", b="table", depth=0.003, speed=0.01, until=1e9)
        )
    loop.push({"arm/z": -0.1}, 2500)
    frames = [frame_of(row) for row in reader.unread()]
    assert reader.lost == 0
    verdicts = [command.verdict for command in loop.commands]
    return gather(frames, names_of(guard.tables)), verdicts


def test_pairs_under_a_contract_are_listed_apart(findings):
    found, verdicts = findings
    touching = {pair.a: pair for pair in found.contracts}
    for finger in ("arm/left", "arm/right"):
        near = [p for v in verdicts for p in v.near if finger in (p.a, p.b)]
        under = [p.distance for p in near if p.contract]
        without = [p.distance for p in near if not p.contract]
        assert min(under) < 0.0 < min(without)
        assert touching[finger].distance == min(under)
        (free,) = [p for p in found.free if finger in (p.a, p.b)]
        assert free.distance == min(without)
    assert found.stops == []


def test_the_page_lists_calls_and_touches(findings):
    found, _ = findings
    text = page(found)
    assert "Nothing touched but what a contract let touch; nearest" in text
    assert "Pairs that were near under a contract" in text
    assert text.count('<td class="t">allow</td>') == 2
