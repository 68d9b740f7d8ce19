"""The mutation run itself, on a package of kernels that call each other."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from mutants.build import NAMED, build, read_named
from mutants.page import page
from mutants.places import Mutant
from mutants.results import added, is_due, record
from mutants.trial import Outcome

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "armguard"

LEAF = """
from armguard.kernel import kernel


@kernel
def way(v: float, d: float) -> float:
    return float(0.5 * v * v / d)


@kernel
def unasked(v: float) -> float:
    return float(v + 1.0)
"""

CALLER = """
from armguard.kernel import kernel
from armguard.motion.leaf import unasked, way


@kernel(entry=True)
def must_stop(v: float, left: float, odd: bool) -> bool:
    if odd:
        return bool(unasked(v) > left)
    k = 0
    while v > 100.0:
        k += 1
    return bool(not left >= max(way(v, 2.0), 0.0))
"""

BY_HAND = """
- name: half the way, in the leaf
  file: motion/leaf.py
  function: way
  before: 0.5 * v * v / d
  after: 0.25 * v * v / d
- name: the same again
  file: guard/caller.py
  function: must_stop
  before: max(way(v, 2.0), 0.0)
  after: way(v, 2.0)
- name: no test asks
  file: motion/leaf.py
  function: unasked
  before: v + 1.0
  after: v - 1.0
"""

TESTS = """
import pytest
from armguard.guard.caller import must_stop


@pytest.fixture(scope="module")
def speed():
    return 2.0


def test_far_off(speed):
    assert not must_stop(speed, 100.0, False)


def test_near_the_bound(speed):
    assert not must_stop(speed, 1.01, False)
    assert must_stop(speed, 0.99, False)
"""

RUN = """
import json, sys
from pathlib import Path
import pytest
from armguard import mutant_switch
from mutants.places import Mutant
from mutants.trial import Trial, tests_of

folder = Path(sys.argv[1])
mutants = [Mutant(**one) for one in json.loads((folder / "mutants.json").read_text())]
found = {}
def keep(mutant, outcome):
    found[mutant.identity] = vars(outcome)
for attempt in range(2):
    trial = Trial(
        mutant_switch, mutants, mutants, folder / "dry.json", {"test_toy.py": "t"},
        {}, 20.0, 2, keep, print
    )
    assert pytest.main(list(tests_of(["test_toy.py"])), [trial]) == 0
    assert mutant_switch.chosen.value == -1
(folder / "found.json").write_text(json.dumps(found))
"""


def built(folder: Path, count: int = 40) -> list[Mutant]:
    """A package of the two kernels, with mutants."""
    source = folder / "plain" / "armguard"
    for name, text in {
        "__init__.py": "",
        "motion/__init__.py": "",
        "motion/leaf.py": LEAF,
        "guard/__init__.py": "",
        "guard/caller.py": CALLER,
        **{
            name: (PACKAGE / name).read_text("utf-8")
            for name in (
                "errors.py",
                "inlined.py",
                "kernel.py",
                "ready.py",
                "separate.py",
            )
        },
    }.items():
        path = source / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    (folder / "named.yaml").write_text(BY_HAND, encoding="utf-8")
    target = folder / "src" / "armguard"
    return build(source, target, count, 0, folder / "named.yaml")


@pytest.fixture(scope="module")
def tried(tmp_path_factory: pytest.TempPathFactory) -> dict[Mutant, dict[str, object]]:
    """Every mutant of the toy and how it fared."""
    folder = tmp_path_factory.mktemp("toy")
    mutants = built(folder)
    (folder / "mutants.json").write_text(json.dumps([vars(one) for one in mutants]))
    (folder / "test_toy.py").write_text(TESTS, encoding="utf-8")
    environment = os.environ | {
        "PYTHONPATH": f"{folder / 'src'}:{ROOT / 'benchmarks'}",
        "ARMGUARD_CACHE": str(folder / "cache"),
    }
    ran = subprocess.run(
        [sys.executable, "-c", RUN, str(folder)],
        env=environment,
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    found = json.loads((folder / "found.json").read_text("utf-8"))
    return {one: found[one.identity] for one in mutants}


def by_name(tried: dict[Mutant, dict[str, object]], name: str) -> dict[str, object]:
    """How the mutant of a name fared."""
    return next(found for one, found in tried.items() if one.change == name)


def test_a_mutant_in_a_leaf_is_seen_through_its_caller_in_another_file(tried) -> None:
    found = by_name(tried, "half the way, in the leaf")
    assert (found["outcome"], found["how"]) == ("killed", "fails")
    assert str(found["by"]).endswith("::test_near_the_bound")


def test_a_mutant_that_changes_nothing_is_not_run(tried) -> None:
    found = by_name(tried, "the same again")
    assert (found["outcome"], found["run"]) == ("same", 0)


def test_a_kernel_that_no_test_calls_is_said_so(tried) -> None:
    assert by_name(tried, "no test asks")["outcome"] == "unreached"


def test_bounds_that_are_a_little_too_small_are_noticed_near_them(tried) -> None:
    outcomes = {
        found["outcome"]
        for one, found in tried.items()
        if one.function == "way" and one.change in ("half", "turned round")
    }
    assert outcomes <= {"killed"}
    assert sum(found["outcome"] == "killed" for found in tried.values()) >= 4


def test_identities_outlive_edits_elsewhere(tmp_path: Path) -> None:
    before = built(tmp_path / "one")
    more = "def more(v: float) -> float:\n    return float(v * 3.0)\n\n\n"
    text = LEAF.replace("def unasked", f"{more}@kernel\ndef unasked")
    source = tmp_path / "one" / "plain" / "armguard" / "motion" / "leaf.py"
    source.write_text(text, encoding="utf-8")
    after = build(
        source.parents[1],
        tmp_path / "two" / "src" / "armguard",
        40,
        0,
        tmp_path / "one" / "named.yaml",
    )
    assert {one.identity for one in before} <= {one.identity for one in after}
    assert {one.number for one in before} <= {one.number for one in after}


def test_what_did_not_change_is_not_written_again(tmp_path: Path) -> None:
    built(tmp_path)
    written = tmp_path / "src" / "armguard" / "motion" / "leaf.py"
    os.utime(written, (1.0, 1.0))
    built(tmp_path)
    assert written.stat().st_mtime == 1.0


def test_a_named_mutant_that_is_gone_is_an_error(tmp_path: Path) -> None:
    built(tmp_path)
    caller = tmp_path / "plain" / "armguard" / "guard" / "caller.py"
    caller.write_text(CALLER.replace("max(", "min("), encoding="utf-8")
    target = tmp_path / "src" / "armguard"
    with pytest.raises(LookupError, match="the same again: must_stop has no"):
        build(caller.parents[1], target, 40, 0, tmp_path / "named.yaml")


def test_every_mutant_by_hand_is_in_the_code(tmp_path: Path) -> None:
    named = read_named(NAMED)
    found = build(PACKAGE, tmp_path / "src" / "armguard", len(named), 0)
    assert {one.change for one in found} == {one.name for one in named}
    assert all(one.by_hand for one in found)


def test_outcomes_of_other_tests_add_up(tmp_path: Path) -> None:
    one = built(tmp_path)[0]

    def entry(outcome: str, passed: dict[str, str]) -> dict[str, object]:
        found = Outcome(outcome, passed=passed)
        return record(one, found, tmp_path) | {"tested": "t", "limit": 1.0}

    lives, killed = entry("lives", {"a.py": "1"}), entry("killed", {})
    assert added(None, lives) == lives
    assert added(lives, entry("unreached", {}))["outcome"] == "lives"
    assert added(lives, killed) == killed
    assert added(killed, lives) == lives
    both = added(lives, entry("lives", {"b.py": "2"}))
    assert both["passed"] == {"a.py": "1", "b.py": "2"}


def test_an_outcome_is_due_when_its_kernel_or_its_test_changes(tmp_path: Path) -> None:
    one = built(tmp_path)[0]
    test = tmp_path / "test_it.py"
    test.write_text("assert True\n", encoding="utf-8")
    killed = Outcome("killed", "test_it.py::test", "fails", 1, 1, 0.1, ["test_it.py"])
    entry = record(one, killed, tmp_path) | {"tested": "t", "limit": 10.0}
    known = {one.identity: entry}
    assert not is_due(one, known, tmp_path, "u", 20.0)
    test.write_text("assert 1\n", encoding="utf-8")
    assert is_due(one, known, tmp_path, "t", 10.0)
    lives = Outcome("lives", run=1, tests=2, seconds=11.0, files=["test_it.py"])
    known = {
        one.identity: record(one, lives, tmp_path) | {"tested": "t", "limit": 10.0}
    }
    assert not is_due(one, known, tmp_path, "t", 10.0)
    assert is_due(one, known, tmp_path, "t", 20.0)
    assert is_due(one, known, tmp_path, "u", 10.0)
    assert is_due(one, {}, tmp_path, "t", 10.0)
    about = {"kernels": "k", "tests": ["test_it.py"], "limit": 10.0, "machine": "m"}
    assert "a test is missing" in page(known, about, {})
    assert "no wider" in page(known, about, {one.identity: "no wider"})
