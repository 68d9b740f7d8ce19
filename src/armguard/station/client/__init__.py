"""Client of the service, with a watchdog of its own."""

from armguard.station.client.answer import Answer, Nearest
from armguard.station.client.client import Client
from armguard.station.client.welcome import RobotJoints, Welcome

__all__ = ["Answer", "Client", "Nearest", "RobotJoints", "Welcome"]
