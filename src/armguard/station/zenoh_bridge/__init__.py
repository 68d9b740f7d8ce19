"""The service's messages over Zenoh, as sealed JSON; see docs/zenoh.md."""

from armguard.station.zenoh_bridge.bridge import Bridge
from armguard.station.zenoh_bridge.client import ZenohClient
from armguard.station.zenoh_bridge.settings import BridgeSettings

__all__ = ["Bridge", "BridgeSettings", "ZenohClient"]
