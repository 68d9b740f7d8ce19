"""How a robot stops, and how well it is known where it is: what its user declares."""

from armguard.robot.stopping.declared import (
    ASSUMPTION,
    declared_figures,
    known_figures,
    named_figures,
)
from armguard.robot.stopping.distance import StopTravel, stop_travel
from armguard.robot.stopping.figures import (
    FiguresError,
    StoppingFigures,
    stopping_figures,
)
from armguard.robot.stopping.link_stops import LinkStop, levers, stop_distances
from armguard.robot.stopping.table import StopTable
from armguard.robot.stopping.table_file import TableFile, read_stop_tables

__all__ = [
    "ASSUMPTION",
    "FiguresError",
    "LinkStop",
    "StopTable",
    "StopTravel",
    "StoppingFigures",
    "TableFile",
    "declared_figures",
    "known_figures",
    "levers",
    "named_figures",
    "read_stop_tables",
    "stop_distances",
    "stop_travel",
    "stopping_figures",
]
