"""Client of the service, with a watchdog of its own."""

from armguard.service.client.answer import Answer, Nearest
from armguard.service.client.client import Client
from armguard.service.client.sensors import SensorClient
from armguard.service.client.welcome import RobotJoints, Welcome

__all__ = ["Answer", "Client", "Nearest", "RobotJoints", "SensorClient", "Welcome"]
