"""Who may place and remove objects of the scene, and what follows from it."""

import logging
import time

from armguard.guard.levels import Reason
from armguard.station.calls import Place, Remove
from armguard.station.errors import RefusedError
from armguard.station.service.hub import Hub
from armguard.station.service.peers import Peer
from armguard.station.wire.keys import Role

log = logging.getLogger("armguard.service")

# Answers say for that long that objects were changed [ns].
SHOWN = 1_000_000_000

# How far a stamp may be ahead of the service's clock, which senders on other machines
# know to half a round trip [ns].
AHEAD = 20_000_000


class Objects:
    """Changes objects for clients that may.

    Objects that the scene calls movable belong to the client that placed or removed
    them last, as long as a client of that name is connected. All others are fixtures.

    Args:
        hub: What all parts of the loop share.
    """

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        # Name of the client that placed or removed an object last.
        self._owner: dict[str, str] = {}
        objects = hub.judge.scene.objects
        self._present = {name for name, thing in objects.items() if thing.present}

    def place(self, peer: Peer, call: Place) -> None:
        """Place an object.

        Raises:
            RefusedError: The client may not.
        """
        name, stamp, now = call.name, call.stamp, time.monotonic()
        self._check(peer, name)
        if stamp is not None and stamp > now + AHEAD * 1e-9:
            raise RefusedError(
                f"'{name}' was seen at {stamp:.3f} s, which is ahead of the service's "
                f"clock; stamps are on that clock, see Client.clock",
                reason=Reason.OBJECT_AHEAD.name,
            )
        if stamp is not None and stamp > now:
            # Its sender knows the clock no better; the next cycle is later than now.
            call = call.model_copy(update={"stamp": now})
        judge = self._hub.judge
        routine = (
            self._owner.get(name) == peer.name
            and judge.scene.objects[name].top_speed > 0.0
            and name in self._present
            and call.shape is None
        )
        judge.do(call)
        self._owner[name] = peer.name
        self._present.add(name)
        if not routine:
            self._tell(peer, name, "placed")

    def remove(self, peer: Peer, call: Remove) -> None:
        """Remove an object.

        Raises:
            RefusedError: The client may not.
        """
        name = call.name
        self._check(peer, name)
        self._hub.judge.do(call)
        self._owner[name] = peer.name
        self._present.discard(name)
        self._tell(peer, name, "removed")

    def _check(self, peer: Peer, name: str) -> None:
        """Refuse what a client may not change.

        Raises:
            RefusedError: It may not.
        """
        hub = self._hub
        thing = hub.judge.scene.objects.get(name)
        if thing is None or (peer.role >= Role.ADMINISTER and thing.movable):
            return
        if not thing.movable:
            if peer.role < Role.ADMINISTER:
                raise RefusedError(
                    f"'{name}' is a fixture: the scene gives it no top_speed, and it "
                    "is present from the start; changing it needs the key for "
                    "'administer'"
                )
            if not hub.judge.at_rest(hub.states):
                raise RefusedError(
                    f"'{name}' is a fixture; it changes only while every robot rests"
                )
            return
        owner = self._owner.get(name, peer.name)
        if owner != peer.name and hub.peers.names(owner):
            raise RefusedError(
                f"'{name}' belongs to client '{owner}', which is connected; that one "
                "changes it, or the key for 'administer' does"
            )

    def _tell(self, peer: Peer, name: str, done: str) -> None:
        """Say that an object was changed: to the log, the recording and all clients."""
        self._hub.changed = time.monotonic_ns() + SHOWN
        self._hub.judge.note("object", name=name, done=done, by=peer.name)
        log.warning("object '%s' was %s by client '%s'", name, done, peer.name)
