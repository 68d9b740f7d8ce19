"""Recording: rings of cycles in memory, calls as data, recorder, replay, comparison.

The recorder and its readers need the packages of `armguard[station]`.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from armguard.recording.recording import Recording, open_recording

__all__ = ["Recording", "open_recording"]


def __getattr__(name: str) -> Any:
    """A public name; late, since clients of a ring need no kernels."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from armguard.recording import recording

    return getattr(recording, name)
