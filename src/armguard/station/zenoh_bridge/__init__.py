"""The service's messages over Zenoh, as JSON; see docs/zenoh.md."""

from armguard.station.zenoh_bridge.bridge import Bridge
from armguard.station.zenoh_bridge.settings import BridgeSettings

__all__ = ["Bridge", "BridgeSettings"]
