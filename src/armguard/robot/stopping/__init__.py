"""How a robot stops, and how well it is known where it is: what its user declares."""

from armguard.robot.stopping.declared import declared_figures
from armguard.robot.stopping.figures import (
    FiguresError,
    StoppingFigures,
    stopping_figures,
)
from armguard.robot.stopping.named import named_figures
from armguard.robot.stopping.table import StopTable

__all__ = [
    "FiguresError",
    "StopTable",
    "StoppingFigures",
    "declared_figures",
    "named_figures",
    "stopping_figures",
]
