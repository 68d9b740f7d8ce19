"""What is hashed of a cycle: the public attributes of its verdict and command."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from struct import pack
from typing import Any

import numpy as np

from armguard.guard.verdict import Verdict
from armguard.respond import Command

# Attributes of a verdict and of a command, without `cycle_time`, which is no decision.
OF_VERDICT = (
    "reason level levels causes last_causes speed_scale ages headroom budget nuisance "
    "protective_distance cues disproved near joint counts"
).split()
OF_COMMAND = "velocity position actions blocked held far_joints passed".split()

# Fields of rows that only some scenes have; without a value they are not hashed.
OPTIONAL = ("sensed",)

# What a cycle is made of; each has a hash of its own in every cycle.
GROUPS = ("verdict", "command", "sentence", "wire", "checkpoint")


def leaves(value: Any) -> Iterator[bytes]:
    """The numbers and texts a value is made of, without names of classes and fields."""
    if value is None:
        yield b"-"
    elif isinstance(value, Enum):
        yield from leaves(value.value)
    elif isinstance(value, (bool, int)):
        yield pack("<q", value)
    elif isinstance(value, float):
        yield pack("<d", value)
    elif isinstance(value, str):
        yield value.encode() + b"\0"
    elif isinstance(value, (np.ndarray, np.generic)):
        yield value.tobytes()
    elif isinstance(value, Mapping):
        for name, part in value.items():
            yield from leaves(name)
            yield from leaves(part)
    elif is_dataclass(value):
        for field in fields(value):
            part = getattr(value, field.name)
            if part is not None or field.name not in OPTIONAL:
                yield from leaves(part)
    else:
        yield pack("<q", len(value))
        for part in value:
            yield from leaves(part)


def parts_of(verdict: Verdict, command: Command | None) -> dict[str, bytes]:
    """The bytes of each attribute, by 'group.attribute'."""
    found = {
        f"verdict.{name}": b"".join(leaves(getattr(verdict, name)))
        for name in OF_VERDICT
    }
    found["sentence.verdict"] = verdict.why.encode()
    if command is not None:
        found |= {
            f"command.{name}": b"".join(leaves(getattr(command, name)))
            for name in OF_COMMAND
        }
        found["sentence.command"] = command.why.encode()
    return found
