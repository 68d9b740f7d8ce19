"""A line of `armguard check`: result, remedy, and the place in the scene file."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from io import StringIO
from typing import Any, Literal

from ruamel.yaml import YAML

Status = Literal["PASS", "WARN", "FAIL"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the check.

    Attributes:
        topic: Subject of the examination.
        status: PASS, WARN or FAIL.
        sentence: The result.
        remedy: The change that is needed, "" if none.
        keys: Keys of the scene file that lead to its subject, such as "robots" and a
            robot's name; empty if it is about the whole scene.
        paste: YAML that is the remedy, to be written below these keys; "" if the
            remedy is no such line.
        blocks: Whether the scene cannot be guarded before the remedy, though it is no
            fault of the scene.
    """

    topic: str
    status: Status
    sentence: str
    remedy: str = ""
    keys: tuple[str, ...] = ()
    paste: str = ""
    blocks: bool = False

    @property
    def row(self) -> dict[str, Any]:
        """All of it, the sentence with its subject."""
        sentence = subject([self.keys]) + self.sentence
        return {**asdict(self), "sentence": sentence, "keys": list(self.keys)}


# A finding, and the keys of all it is about.
Merged = tuple[Finding, list[tuple[str, ...]]]


def merged(findings: Iterable[Finding]) -> list[Merged]:
    """Findings without repetition, each with the keys of its subjects."""
    found: dict[Finding, list[tuple[str, ...]]] = {}
    for finding in findings:
        like = replace(finding, keys=finding.keys[:1])
        found.setdefault(like, []).append(finding.keys)
    return list(found.items())


def subject(keys: list[tuple[str, ...]]) -> str:
    """The subjects of a finding, to precede its sentence.

    Example:
        >>> subject([("robots", "left"), ("robots", "right")])
        "robots 'left', 'right': "
    """
    named = [key for key in keys if len(key) > 1]
    if not named:
        return ""
    kind = named[0][0] if len(named) > 1 else named[0][0].removesuffix("s")
    return f"{kind} {', '.join(repr(key[1]) for key in named)}: "


def in_yaml(value: Any) -> str:
    """A value in one line of YAML.

    Example:
        >>> in_yaml({"home": {"joint 1": 0.5}})
        '{home: {joint 1: 0.5}}'
    """
    yaml, text = YAML(typ="safe", pure=True), StringIO()
    yaml.default_flow_style, yaml.width = True, 1_000_000
    yaml.sort_base_mapping_type_on_output = False
    yaml.dump(value, text)
    return text.getvalue().removesuffix("...\n").strip()
