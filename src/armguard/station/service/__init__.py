"""The loop: messages in, a cycle, messages out; watchdogs; the right to command."""

from armguard.station.service.service import Service
from armguard.station.service.settings import ServiceSettings

__all__ = ["Service", "ServiceSettings"]
