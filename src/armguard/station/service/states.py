"""The newest state of every robot, and who sends it."""

from armguard.station.desk.desk import MEASURED, Desk


class States:
    """What controllers measured last: the part of a desk that is about them.

    Attributes:
        sender: Controller of each robot, 0 for none yet.
        sequence: Number of the state of each robot.
        complete: Whether every robot has had one.

    Args:
        desk: The desk.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self.sender = desk.sender.data.cast("B").cast("Q")
        self.sequence = desk.sequence.data.cast("B").cast("Q")
        self.complete = False

    def look(self) -> None:
        """A state was taken over."""
        if not self.complete:
            self.complete = 0 not in self.sender

    def release(self, sender: int) -> None:
        """A controller has left; its robots may get another one at once."""
        for r, own in enumerate(self.sender):
            if own == sender:
                self.sender[r] = 0

    def rest(self, speed: float) -> bool:
        """Whether no joint was measured to be faster than that [rad/s or m/s]."""
        desk = self._desk
        return not desk.given[MEASURED] or bool((abs(desk.velocity) < speed).all())
