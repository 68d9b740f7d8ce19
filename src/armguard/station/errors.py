"""What can go wrong at the edge, before the loop or beside it."""

from armguard.errors import ArmguardError


class StationError(ArmguardError):
    """The station cannot do what it was asked for."""


class RingError(StationError):
    """There is no ring, or no room in it."""


class RecordingError(StationError):
    """A recording cannot be read, or cannot do what it was asked for."""


class SettingError(StationError):
    """There is no such setting, or it cannot have that value."""
