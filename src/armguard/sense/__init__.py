"""Sensors fill the map of cells; links and models are filtered, faults named."""

from armguard.sense.frames import Intake
from armguard.sense.health import Fault, SensorHealth
from armguard.sense.sense import Sense

__all__ = ["Fault", "Intake", "Sense", "SensorHealth"]
