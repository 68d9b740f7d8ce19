"""Each attack of the campaign, a few tries of each: none has its effect."""

import json
from dataclasses import asdict

import pytest

from attack import connects, desires, rack, row, service, starts


def failed(rows):
    """Attacks that were not answered as they are to be."""
    return [(r.attack, r.had, r.unit, r.note) for r in rows if not r.passed]


def test_keys_roles_and_contents():
    rows = service.run(20)
    floods = [one for one in rows if one.attack.startswith("flood")]
    # What a flood costs depends on the machine; that nothing goes wrong does not.
    assert not any(one.had for one in floods)
    assert not failed(one for one in rows if one not in floods)


@pytest.mark.realtime
def test_fixtures_stand_while_an_arm_is_driven_into_one():
    assert not failed(rack.run(1))


@pytest.mark.realtime
def test_desired_motion_that_is_late():
    assert not failed(desires.run(2))


def test_a_service_that_was_killed_and_recordings_of_starts():
    assert starts.killed(1) == (1, 1, 1)
    files = starts.recorded_start()
    assert files
    assert not any(code for code, _ in files), files


def test_clients_come_and_go():
    rows = connects.run(100, 60.0)
    assert not failed(rows)


@pytest.mark.parametrize("had", [0, 1])
def test_the_table_is_between_its_marks(tmp_path, had):
    file = tmp_path / "page.md"
    file.write_text(f"before\n{row.BEGIN}\nold\n{row.END}\nafter\n")
    one = asdict(row.none("an attack", 10, had, note="a | b"))
    results = json.loads(json.dumps({"door": {"rows": [one]}}))
    row.write_table(results, file)
    text = file.read_text()
    assert text.startswith("before\n") and text.endswith("after\n")
    assert "old" not in text
    verdict = "**FAIL**" if had else "PASS"
    assert f"| an attack | 10 | 0 | {had} accepted; a \\| b | {verdict} |" in text
