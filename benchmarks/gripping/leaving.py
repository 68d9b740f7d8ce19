"""What operators do who do not get on: let go, and go where the cues lead."""

import numpy as np

from armguard.respond import Action
from gripping.plant import Plant

# How long they let go, and how long they then go away at most [s].
LET_GO, AWAY = 0.1, 1.5

# How fast they go away [m/s], and what the nearest pair then has left [m].
SPEED, ROOM = 0.03, 0.004


def leave(plant: Plant, *, fingers: bool) -> bool:
    """Leave what is too near; whether the robot follows again.

    Args:
        plant: The robot, after a command.
        fingers: Whether fingers may move: not while they hold something.
    """
    still = np.zeros(len(plant.q))
    command = plant.drive(still)
    for _ in range(int(LET_GO / plant.period)):
        command = plant.drive(still)
    for _ in range(int(AWAY / plant.period)):
        nearest = command.verdict.nearest
        follows = command.action < Action.STOP
        if follows and (nearest is None or nearest.clearance > ROOM):
            return True
        wish = SPEED * np.asarray(command.verdict.cues["arm"].escape)
        if not fingers:
            wish[plant.fingers] = 0.0
        command = plant.drive(wish)
    return bool(command.action < Action.STOP)
