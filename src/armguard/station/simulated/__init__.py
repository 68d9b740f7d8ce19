"""Arms that stand in for real ones, and a tele-driver that drives them."""

from armguard.station.simulated.drives import Drives, Phase
from armguard.station.simulated.operator import Operator
from armguard.station.simulated.plant import PERFECT, Imperfection, Plant
from armguard.station.simulated.tele import TeleDriver

__all__ = [
    "PERFECT",
    "Drives",
    "Imperfection",
    "Operator",
    "Phase",
    "Plant",
    "TeleDriver",
]
