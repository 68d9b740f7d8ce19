"""The loop: messages in, a cycle, messages out; watchdogs; the right to command."""

from armguard.service.server.service import Service
from armguard.service.server.settings import ServiceSettings

__all__ = ["Service", "ServiceSettings"]
