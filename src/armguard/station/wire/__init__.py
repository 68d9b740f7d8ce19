"""Messages byte for byte; docs/service.md explains them."""

from armguard.station.wire.keys import Keys, Role, read_keys
from armguard.station.wire.layout import Cause, Form, Kind
from armguard.station.wire.outbox import Outbox, Seal

__all__ = ["Cause", "Form", "Keys", "Kind", "Outbox", "Role", "Seal", "read_keys"]
