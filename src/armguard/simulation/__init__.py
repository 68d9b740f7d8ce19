"""Arms that stand in for real ones, and a tele-driver that drives them."""

from armguard.simulation.drives import Drives, Phase
from armguard.simulation.operator import Operator
from armguard.simulation.plant import PERFECT, Imperfection, Plant
from armguard.simulation.tele import TeleDriver

__all__ = [
    "PERFECT",
    "Drives",
    "Imperfection",
    "Operator",
    "Phase",
    "Plant",
    "TeleDriver",
]
