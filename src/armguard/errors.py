"""The family of errors raised at the door, before the loop runs.

Inside the loop nothing is raised: there a bad input is a `Reason` of the verdict.
"""

from collections.abc import Iterable
from difflib import get_close_matches
from enum import IntEnum
from typing import Self


class NamedNumber(IntEnum):
    """A number that prints as its name."""

    def __str__(self) -> str:
        """The name, as in "STOP"."""
        return self.name

    def __format__(self, form: str) -> str:
        """The name, also in f-strings."""
        return format(self.name, form)


class WithSentence(NamedNumber):
    """Numbers of a kind, each declared as a row: number, sentence, further attributes.

    Attributes:
        sentence: The meaning of the number in words.
    """

    sentence: str

    def __new__(cls, number: int, sentence: str = "", *_: object) -> Self:
        """A member, of its row; a class with further attributes takes them itself."""
        member = int.__new__(cls, number)
        member._value_, member.sentence = number, sentence
        return member


class ArmguardError(Exception):
    """Any error this package raises on purpose."""


class ShapeError(ArmguardError, ValueError):
    """A shape has a size that is not finite, negative or zero."""


class PoseError(ArmguardError, ValueError):
    """A pose is not a rigid transform."""


class ModelError(ArmguardError, ValueError):
    """A robot description cannot be guarded as it is written."""


class MeshError(ModelError):
    """A mesh file is missing, empty or not finite."""


class SceneError(ArmguardError, ValueError):
    """A scene, or the file it came from, contradicts itself."""


class HomeContactError(SceneError):
    """Checked bodies overlap at the home configuration.

    Attributes:
        contacts: The near pairs that overlap.
    """

    def __init__(self, message: str, contacts: tuple[object, ...]) -> None:
        super().__init__(message)
        self.contacts = contacts


class UnknownNameError(SceneError, KeyError):
    """An unknown name; the message lists the nearest ones."""

    def __str__(self) -> str:
        """Message without the quotes that KeyError adds."""
        return str(self.args[0])


class GraspError(ArmguardError, ValueError):
    """A grasp, a release or a permission is not possible in this state."""


class SelfTestError(ArmguardError, RuntimeError):
    """A guard did not answer its own test as it must, and is not armed."""


class GoalError(ArmguardError, ValueError):
    """A goal that a robot cannot be given."""


class NoRetreatError(ArmguardError, RuntimeError):
    """A retreat has no way to go: none is remembered, or none of them is free."""


class TrajectoryError(ArmguardError, ValueError):
    """A motion file does not fit the scene's joints."""


class OctreeError(ArmguardError, ValueError):
    """An octree cannot have the requested settings."""


class CellMapError(ArmguardError, ValueError):
    """A map of cells, its frame or its file is not as required."""


class StationError(ArmguardError):
    """The service, or a process beside it, cannot do what a caller requests."""


class RingError(StationError):
    """There is no ring, or no room in it."""


class KeyFileError(StationError, ValueError):
    """A file holds no key."""


class ServiceError(StationError, RuntimeError):
    """The service cannot start."""


class NoServiceError(StationError, OSError):
    """No service answers, or it speaks another version or has another key."""


class RefusedError(StationError, RuntimeError):
    """The service refused a request; the message is its sentence.

    Attributes:
        kind: Name of the error at the service.
        reason: Name of the `Reason` of the verdicts that follow; "" if it has none.
    """

    def __init__(self, message: str, kind: str = "", reason: str = "") -> None:
        super().__init__(message)
        self.kind = kind
        self.reason = reason


class RecordingError(StationError):
    """A recording cannot be read, or does not permit the request."""


class SettingError(StationError):
    """There is no such setting, or it cannot have that value."""


def did_you_mean(name: str, known: Iterable[str], limit: int = 3) -> str:
    """Sentence that offers the names nearest to a wrong one.

    Example:
        >>> did_you_mean("left/forarm", ["left/forearm", "right/forearm"])
        "did you mean 'left/forearm', 'right/forearm'?"
        >>> did_you_mean("x", ["left", "right"])
        "known names are 'left', 'right'"
    """
    names = list(known)
    near = get_close_matches(name, names, n=limit, cutoff=0.6)
    if near:
        return "did you mean " + ", ".join(f"'{n}'" for n in near) + "?"
    return known_names(names, 12)


def known_names(known: Iterable[str], limit: int | None = None) -> str:
    """Sentence that lists names and suggests none; for robots, which differ.

    Args:
        known: The names.
        limit: Greatest count of names to list; all if None.

    Example:
        >>> known_names(["ur5", "ur3"])
        "known names are 'ur5', 'ur3'"
    """
    names = list(known)
    if not names:
        return "there are none"
    shown = ", ".join(f"'{n}'" for n in names[:limit])
    hidden = len(names) - len(names[:limit])
    return f"known names are {shown}" + (f" and {hidden} more" if hidden else "")
