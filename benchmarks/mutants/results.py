"""What is known of every mutant, kept in docs/mutants.json, and what is due again."""

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from mutants.places import Mutant
from mutants.trial import Outcome

EQUIVALENT = Path(__file__).with_name("equivalent.yaml")

# What of a mutant is kept beside its outcome.
KEPT = "file function line at change before after source by_hand".split()

# Outcomes, the one that says most first.
RANK = ("unfit", "killed", "lives", "same", "unreached")

Known = dict[str, dict[str, Any]]


def read_results(path: Path) -> Known:
    """Outcomes by identity."""
    if not path.exists():
        return {}
    found: Known = json.loads(path.read_text("utf-8"))["mutants"]
    return found


def read_tests(path: Path) -> list[str]:
    """Tests that the outcomes rest on."""
    if not path.exists():
        return []
    return list(json.loads(path.read_text("utf-8"))["about"]["tests"])


def write_results(path: Path, known: Known, about: Mapping[str, Any]) -> None:
    """Keep the outcomes, one line each; a run that is ended leaves a whole file."""
    lines = [f"  {json.dumps(key)}: {json.dumps(known[key])}" for key in sorted(known)]
    text = ",\n".join(lines)
    new = path.with_suffix(f".{os.getpid()}")
    new.write_text(
        f'{{\n "about": {json.dumps(about)},\n "mutants": {{\n{text}\n }}\n}}\n',
        "utf-8",
    )
    new.replace(path)


def record(mutant: Mutant, outcome: Outcome, root: Path) -> dict[str, Any]:
    """What is kept of a mutant.

    Args:
        mutant: The mutant.
        outcome: How it fared.
        root: Folder that the tests' names start from.
    """
    entry = {name: getattr(mutant, name) for name in KEPT}
    entry |= {key: value for key, value in asdict(outcome).items() if value}
    if outcome.outcome == "killed":
        entry.pop("files", None)
    entry["digest"] = digest_of(files_of(entry), root)
    return entry


def added(before: Mapping[str, Any] | None, now: dict[str, Any]) -> dict[str, Any]:
    """An outcome beside what other tests said of the same mutant before.

    One that these tests do not reach is no less reached by those. One that was killed
    is tried again only if the test that killed it has changed: that is void.
    """
    if before is None or before["source"] != now["source"]:
        return now
    if before["outcome"] == "killed":
        return now
    if min(before["outcome"], now["outcome"], key=RANK.index) == before["outcome"]:
        if before["outcome"] != now["outcome"]:
            return {**before, "tested": now["tested"]}
        both = {**before.get("passed", {}), **now.get("passed", {})}
        return {**now, "passed": both} if both else now
    return now


def files_of(entry: Mapping[str, Any]) -> list[str]:
    """The tests' files an outcome rests on."""
    if entry.get("by"):
        return [entry["by"].split("::")[0]]
    return list(entry.get("files", []))


def digest_of(files: Iterable[str], root: Path) -> str:
    """Hash of files; of one that is gone as well."""
    digest = sha256()
    for name in files:
        path = root / name
        digest.update(path.read_bytes() if path.exists() else b"")
    return digest.hexdigest()[:12]


def is_due(
    mutant: Mutant, known: Known, root: Path, all_files: str, limit: float
) -> bool:
    """Whether a mutant has to be tried: its kernel or its tests changed, or never was.

    Args:
        mutant: The mutant.
        known: What is known.
        root: Folder that the tests' names start from.
        all_files: Digest of all tests; one that lives is due when any changes.
        limit: Time a mutant's tests may take now; one that lived through less is due.
    """
    entry = known.get(mutant.identity)
    if entry is None or entry["source"] != mutant.source:
        return True
    if entry["outcome"] == "killed":
        return bool(entry["digest"] != digest_of(files_of(entry), root))
    if entry["outcome"] == "unfit":
        return False
    cut = entry.get("run", 0) < entry.get("tests", 0)
    too_little = entry.get("seconds", 0.0) < limit
    return bool(entry["tested"] != all_files or (cut and too_little))


def read_equivalent(path: Path = EQUIVALENT) -> dict[str, str]:
    """Why a mutant that lives changes nothing that could be decided, by identity."""
    return dict(YAML(typ="safe").load(path) or {}) if path.exists() else {}
