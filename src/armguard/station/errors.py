"""What can go wrong at the edge, before the loop or beside it."""

from armguard.errors import ArmguardError


class StationError(ArmguardError):
    """The station cannot do what it was asked for."""


class RingError(StationError):
    """There is no ring, or no room in it."""


class KeyFileError(StationError, ValueError):
    """A file holds no key."""


class ServiceError(StationError, RuntimeError):
    """The service cannot start."""


class NoServiceError(StationError, OSError):
    """No service answers, or it speaks another version or has another key."""


class RefusedError(StationError, RuntimeError):
    """The service refused what it was asked for; the message is its sentence.

    Attributes:
        kind: Name of the error at the service.
        reason: Name of the `Reason` of the verdicts that follow; "" if it has none.
    """

    def __init__(self, message: str, kind: str = "", reason: str = "") -> None:
        super().__init__(message)
        self.kind = kind
        self.reason = reason


class RecordingError(StationError):
    """A recording cannot be read, or cannot do what it was asked for."""


class SettingError(StationError):
    """There is no such setting, or it cannot have that value."""
