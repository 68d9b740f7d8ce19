"""The service's messages over Zenoh, as sealed JSON; see docs/zenoh.md."""

from armguard.bridges.zenoh_bridge.bridge import Bridge
from armguard.bridges.zenoh_bridge.client import ZenohClient
from armguard.bridges.zenoh_bridge.settings import BridgeSettings

__all__ = ["Bridge", "BridgeSettings", "ZenohClient"]
