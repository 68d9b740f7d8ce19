"""Messages, byte for byte; what they mean is told in docs/service.md."""

from armguard.station.wire.layout import Form, Kind, MessageError
from armguard.station.wire.outbox import Outbox
from armguard.station.wire.seal import Seal, read_key
from armguard.station.wire.words import Cause

__all__ = ["Cause", "Form", "Kind", "MessageError", "Outbox", "Seal", "read_key"]
