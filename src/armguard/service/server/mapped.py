"""Changes of the map, taken in order and a few in each cycle; health of sensors."""

import logging
from typing import Any

import numpy as np

from armguard.cells.deltas import Delta
from armguard.errors import CellMapError
from armguard.record import dtype_of, records
from armguard.recording.calls import UpdateCells
from armguard.service.server.context import Context
from armguard.service.server.peers import Peer
from armguard.service.wire import Kind
from armguard.service.wire.layout import HEADER, SEAL
from armguard.service.wire.sensing import (
    CELLS,
    CELLS_TAKEN,
    CHANGE,
    HEALTH,
    MOST_IN_A_CYCLE,
    SENSOR,
)

log = logging.getLogger("armguard.service")

# A map that is silent for longer may be replaced by another one [ns].
SILENT = 500_000_000


class MappedCells:
    """Lets the guard take the changes of one map.

    A change that is lost would leave a body out. So CELLS are numbered, taken in their
    order, and answered with the number of the last one; a map sends again what follows
    that. When another map begins, all that the guard knows free is forgotten first.

    Args:
        context: State that all parts of the loop share.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        self.begin_anew()

    def begin_anew(self) -> None:
        """The guard is a new one, which has no cells."""
        self._sender = self._stream = self._last = self._heard = 0
        self._left, self._stamp = MOST_IN_A_CYCLE, -np.inf
        self._forgotten: Any = records(0, Delta)

    def renew(self) -> None:
        """Take as many changes again; first forget what the map before knew."""
        self._left = MOST_IN_A_CYCLE
        if len(self._forgotten):
            some = self._forgotten[:MOST_IN_A_CYCLE]
            self._forgotten = self._forgotten[MOST_IN_A_CYCLE:]
            self._context.judge.do(UpdateCells(deltas=some, stamp=self._stamp))

    def take_cells(self, peer: Peer, message: memoryview, now: int) -> str:
        """Take changes over, and answer; why they were dropped, "" if they were not."""
        payload = message[HEADER.size : -SEAL]
        if (
            len(payload) < CELLS.size
            or (len(payload) - CELLS.size) % CHANGE.size
            or not (head := CELLS.unpack_from(payload)).stream
        ):
            return "payload"
        if not self._belongs_to(peer, now):
            return "second_map"
        if head.stream != self._stream:
            if head.number != 1:
                # Of a guard that was replaced, or a map that was silent for too long.
                self._answer(peer, head.stream, 0)
                return "cells_order"
            self._adopt(peer, head.stream)
        if head.number != self._last + 1:
            self._answer(peer, head.stream, self._last)
            return "" if head.number <= self._last else "cells_order"
        rows = np.frombuffer(payload[CELLS.size :], dtype_of(Delta)).view(np.recarray)
        if len(self._forgotten) or len(rows) > self._left:
            return "busy"
        # Its first claims may be older than the last ones of the map before. They are
        # about space of which nothing is known since.
        stamp = self._stamp if head.stamp < self._stamp else head.stamp
        try:
            self._context.judge.do(UpdateCells(deltas=rows, stamp=stamp))
        except CellMapError as error:
            self._context.log.report("cells", str(error), now)
            return "cells"
        self._left -= len(rows)
        self._last, self._stamp = head.number, stamp
        self._context.counters.count("cells")
        self._answer(peer, head.stream, self._last)
        return ""

    def take_health(self, peer: Peer, message: memoryview, now: int) -> str:
        """Hand the health of sensors on to all clients, and write it down."""
        payload = bytes(message[HEADER.size : -SEAL])
        if len(payload) < HEALTH.size:
            return "payload"
        head, names = HEALTH.unpack_from(payload), [*self._context.judge.scene.sensors]
        if len(payload) != HEALTH.size + head.rows * SENSOR.size or (
            head.first + head.rows > len(names)
        ):
            return "payload"
        if not self._belongs_to(peer, now):
            return "second_map"
        if peer.calls_left <= 0:
            return "busy"
        peer.calls_left -= 1
        context = self._context
        found = zip(
            names[head.first :], SENSOR.rows(payload[HEALTH.size :]), strict=False
        )
        sensors = {
            name: {
                "says": row.words.rstrip(b"\0").decode(errors="replace"),
                "frees": bool(row.frees),
                "stamp": row.stamp,
            }
            for name, row in found
        }
        context.judge.note("sensors", sensors=sensors, stamp=head.stamp)
        handed = context.outbox.message(Kind.HEALTH, payload)
        for other in context.peers.here:
            if other is not peer:
                context.send(handed, other)
        return ""

    def _belongs_to(self, peer: Peer, now: int) -> bool:
        """Whether a client is the map's process; a silent one can be replaced."""
        if peer.sender != self._sender:
            known = self._context.peers.find(self._sender)
            if known is not None and now - self._heard <= SILENT:
                return False
            self._sender = peer.sender
        self._heard = now
        return True

    def _adopt(self, peer: Peer, stream: int) -> None:
        """Begin with the changes of a new map."""
        guard = self._context.judge.guard.guard
        self._forgotten, self._stamp = guard.forgetting()
        self._stream, self._last = stream, 0
        self._context.counters.count("maps")
        log.info("client '%s' sends a new map of cells", peer.name)

    def _answer(self, peer: Peer, stream: int, number: int) -> None:
        taken = CELLS_TAKEN.pack(stream, number)
        self._context.send(self._context.outbox.message(Kind.CELLS_TAKEN, taken), peer)
