"""Messages byte for byte; docs/service.md explains them."""

from armguard.recording.rights import Role
from armguard.service.wire.keys import Keys, read_keys
from armguard.service.wire.layout import Cause, Form, Kind
from armguard.service.wire.outbox import Outbox, Seal

__all__ = ["Cause", "Form", "Keys", "Kind", "Outbox", "Role", "Seal", "read_keys"]
