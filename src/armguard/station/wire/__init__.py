"""Messages, byte for byte; what they mean is told in docs/service.md."""

from armguard.station.wire.keys import Keys, Role, read_keys
from armguard.station.wire.layout import Form, Kind, MessageError
from armguard.station.wire.outbox import Outbox
from armguard.station.wire.seal import Seal
from armguard.station.wire.words import Cause

__all__ = [
    "Cause",
    "Form",
    "Keys",
    "Kind",
    "MessageError",
    "Outbox",
    "Role",
    "Seal",
    "read_keys",
]
