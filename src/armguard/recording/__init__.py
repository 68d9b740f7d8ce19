"""Edge: what remembers the guard: recorder, recovery, replay and comparison.

Needs the packages of `armguard[station]`.
"""

from armguard.recording.recording import Recording, open_recording

__all__ = ["Recording", "open_recording"]
