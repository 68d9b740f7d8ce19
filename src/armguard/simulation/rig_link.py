"""What programs ask of simulated sensors: which are at fault, where the boxes are."""

from collections.abc import Mapping
from typing import Any

from armguard.service.link import LinkEnd, ask

# Faults: no distance is measured; no frame comes; stamps are a second ahead, or ten
# seconds back.
FAULTS = ("blind", "lost", "ahead", "back")


class RigEnd(LinkEnd):
    """The rig's end.

    Attributes:
        faults: Faults of sensors by name, of `FAULTS`.

    Args:
        port: Port of the service.
        state: Further values of the answers, ready for JSON.
    """

    def __init__(self, port: int, state: dict[str, Any]) -> None:
        super().__init__(port, "rig")
        self.faults: dict[str, str] = {}
        self._state = state

    def hear(self, names: list[str]) -> None:
        """Answer the questions that came.

        Args:
            names: Names of the sensors.
        """

        def reply(question: dict[str, Any]) -> dict[str, Any]:
            if "faults" in question:
                found = question["faults"].items()
                known = [(k, v) for k, v in found if k in names and v in FAULTS]
                self.faults = dict(known)
            return {"faults": self.faults, **self._state}

        self.answer(reply)


def ask_rig(
    port: int, faults: Mapping[str, str] | None = None
) -> dict[str, Any] | None:
    """State of the simulated sensors beside a service; None if there are none.

    Args:
        port: Port of the service.
        faults: Faults of sensors from now on, by name; as before if None.

    Returns:
        `faults`: as above; `boxes`: for each box `size` [m] and `xyz` [m].
    """
    return ask(port, "rig", {} if faults is None else {"faults": dict(faults)})
