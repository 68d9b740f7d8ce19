"""Changes of a map over a link that loses, doubles and delays messages."""

import random
from types import SimpleNamespace

import numpy as np
import pytest

from armguard import CellMap, Pose
from armguard.guard.clusters import Cluster
from armguard.record import records
from armguard.recording.calls import UpdateClusters
from armguard.respond import Guard
from armguard.service.mapping.delivery import FOLLOWS, Delivery
from armguard.service.server.mapped import SILENT, MappedCells
from armguard.service.server.rpc import read_call
from armguard.service.wire import Kind, Outbox
from armguard.service.wire.sensing import (
    CELLS,
    CELLS_TAKEN,
    CHANGE,
    HEALTH,
    MOST_CHANGES,
    MOST_IN_A_CYCLE,
    SENSOR,
)
from sensed import CELL, CENTRE, PERIOD, SIZE, sensed_scene

DOWN = Pose(xyz=(0, 0, 2.2), rpy=(np.pi, 0, 0))


class Filled:
    """A map that images fill, as `Sense` has one."""

    def __init__(self, seed=0):
        self.cells = CellMap(CENTRE, CELL, SIZE)
        self.rng = np.random.default_rng(seed)
        self.stamp, self.sent = -np.inf, -1.0
        self.clusters = records(0, Cluster)

    def look(self, stamp):
        image = np.full((48, 64), 2.4)
        x, y = self.rng.integers(0, (40, 56))
        image[x : x + 6, y : y + 6] = self.rng.uniform(0.8, 1.6)
        self.cells.depth(image, DOWN, 50.0, (31.5, 23.5), stamp)
        self.stamp = stamp

    def changes(self, most):
        found = self.cells.take_deltas(most)
        if len(found) < most:
            self.sent = self.stamp
        return found


class Desk:
    """A service's guard, and what its map's messages meet."""

    def __init__(self, guard):
        self.guard, self.sent, self.counts, self.done = guard, [], {}, []
        self.peer = SimpleNamespace(sender=5, name="map", calls_left=16)
        self.outbox = Outbox(None, 0)
        context = SimpleNamespace(
            judge=self,
            peers=SimpleNamespace(find=lambda sender: None, here=()),
            counters=SimpleNamespace(count=self.count),
            log=SimpleNamespace(report=lambda *_: None),
            outbox=self.outbox,
            send=lambda message, peer: self.sent.append(bytes(message)[48:-16]),
        )
        self.context = context
        self.mapped = MappedCells(context)

    # The judge's guard is within one that records.
    guard = property(lambda self: SimpleNamespace(guard=self._guard))

    @guard.setter
    def guard(self, guard):
        self._guard = guard

    def do(self, call):
        self.done.append(len(call.deltas))
        call.apply(self._guard)

    def count(self, name):
        self.counts[name] = self.counts.get(name, 0) + 1

    def hear(self, payload, peer=None, kind=Kind.CELLS, now=0):
        message = memoryview(bytes(self.outbox.message(kind, payload)))
        take = {
            Kind.CELLS: self.mapped.take_cells, Kind.HEALTH: self.mapped.take_health
        }[kind]  # fmt: skip
        return take(peer or self.peer, message, now)

    @property
    def claims(self):
        return self._guard._sensed.table.claims

    @property
    def stamp(self):
        return float(self._guard._sensed.table.about.stamp)


@pytest.fixture(scope="module")
def made():
    return sensed_scene("still")


@pytest.fixture
def desk(made):
    return Desk(Guard(made, self_test=False))


def into(payloads):
    """Sends into a list of payloads of CELLS; no other kind is sent."""

    def send(kind, payload):
        assert kind is Kind.CELLS
        payloads.append(payload)

    return send


def same(claims, cells):
    occupied = claims.occupied.words == cells.claims.occupied.words
    unknown = claims.unknown.words == cells.claims.unknown.words
    return occupied.all() and unknown.all()


@pytest.mark.parametrize("lossy", [0.0, 0.3])
def test_the_guard_has_the_map_whatever_is_lost_and_no_stamp_before_its_changes(
    desk, lossy
):
    filled, draw, now = Filled(), random.Random(4), [0.0]
    on_the_way, at = [], {}
    delivery = Delivery(filled, into(on_the_way), PERIOD, lambda: now[0])
    highest = 0
    for cycle in range(900):
        now[0] = cycle * PERIOD
        if cycle % 12 == 0 and cycle < 600:
            filled.look(now[0])
        delivery.run()
        if filled.sent == filled.stamp and filled.sent not in at:
            at[filled.sent] = filled.cells.claims.occupied.words.copy()
        if lossy:
            draw.shuffle(on_the_way)
        for payload in on_the_way:
            for _ in range(draw.choice((0, 1, 2)) if draw.random() < lossy else 1):
                before = desk.stamp
                desk.hear(payload)
                if desk.stamp > before and desk.stamp in at:
                    # All that was to be known at this time is known.
                    assert (desk.claims.occupied.words == at[desk.stamp]).all()
        on_the_way.clear()
        for answer in desk.sent:
            if draw.random() >= lossy:
                assert delivery.take(CELLS_TAKEN.unpack_from(answer))
        desk.sent.clear()
        desk.mapped.renew()
        highest = max(highest, sum(desk.done))
        desk.done.clear()
    assert 0 < highest <= MOST_IN_A_CYCLE
    assert same(desk.claims, filled.cells) and desk.stamp == filled.stamp
    assert filled.cells.occupied().any() and filled.cells.known_free().any()


def deliver(desk, filled, cycles=600, start=0.0):
    """Fill the guard with a map over a link that loses nothing."""
    on_the_way, now = [], [start]
    delivery = Delivery(filled, into(on_the_way), PERIOD, lambda: now[0])
    drops = set()
    for _ in range(cycles):
        now[0] += PERIOD
        delivery.run()
        drops |= {desk.hear(one) for one in on_the_way}
        on_the_way.clear()
        for answer in desk.sent:
            delivery.take(CELLS_TAKEN.unpack_from(answer))
        desk.sent.clear()
        desk.mapped.renew()
    return drops


def test_a_new_map_permits_nothing_that_the_one_before_knew(desk):
    first, second = Filled(1), Filled(2)
    first.look(1.0)
    deliver(desk, first)
    known = desk.claims.unknown.words.copy()
    assert same(desk.claims, first.cells)
    # It has seen nothing yet, and says so at a later time.
    second.stamp = second.sent = 2.0
    desk.hear(CELLS.pack(7, 1, 2.0))
    while len(desk.mapped._forgotten):
        # Nothing of it is taken before all is forgotten, and no time goes by.
        assert desk.hear(CELLS.pack(7, 1, 2.0)) == "busy" and desk.stamp == 1.0
        desk.mapped.renew()
        assert max(desk.done) <= MOST_IN_A_CYCLE
    free = ~(desk.claims.occupied.words | desk.claims.unknown.words)
    assert not free.any() and (~known).any()
    # What was occupied stays until the new map has looked there.
    assert (desk.claims.occupied.words == first.cells.claims.occupied.words).all()
    assert desk.hear(CELLS.pack(7, 1, 2.0)) == "" and desk.stamp == 2.0


def test_claims_of_a_new_map_replace_those_of_the_one_before(desk):
    first, second = Filled(1), Filled(2)
    first.look(1.0)
    deliver(desk, first)
    second.look(2.0)
    assert deliver(desk, second, start=10.0) <= {"", "busy", "cells_order"}
    # Words in which the new map has claims are its own.
    own = second.cells.claims.unknown.words != ~np.uint64(0)
    occupied = second.cells.claims.occupied.words
    assert (desk.claims.occupied.words[own] == occupied[own]).all()
    assert desk.counts["maps"] == 2 and desk.stamp == 2.0


def test_a_second_map_is_refused_until_the_first_one_is_silent(desk):
    other = SimpleNamespace(sender=6, name="second", calls_left=16)
    desk.context.peers.find = {5: desk.peer, 6: other}.get
    assert desk.hear(CELLS.pack(3, 1, 1.0)) == ""
    assert desk.hear(CELLS.pack(4, 1, 1.5), other, now=SILENT) == "second_map"
    assert desk.hear(CELLS.pack(4, 1, 1.5), other, now=SILENT + 1) == ""
    # The first one goes on, and is not the map any more.
    assert desk.hear(CELLS.pack(3, 2, 1.6), now=SILENT + 2) == "second_map"


def test_a_guard_that_was_made_anew_has_the_map_begin_anew(desk):
    filled = Filled()
    filled.look(1.0)
    sent = []
    delivery = Delivery(filled, into(sent), PERIOD, lambda: 1.0)
    delivery.run()
    for one in sent:
        desk.hear(one)
    taken = [CELLS_TAKEN.unpack_from(one) for one in desk.sent]
    assert all(delivery.take(one) for one in taken) and taken[-1].number == len(sent)
    desk.mapped.begin_anew()
    desk.sent.clear()
    assert desk.hear(CELLS.pack(taken[0].stream, 9, 2.0)) == "cells_order"
    assert not delivery.take(CELLS_TAKEN.unpack_from(desk.sent[0]))


def moving(x):
    """A body that moves."""
    found = records(1, Cluster)
    found["low"], found["high"] = (x, 0.0, 1.0), (x + 0.1, 0.1, 1.1)
    found["velocity"], found["number"] = (-0.3, 0.0, 0.0), 7
    return found


def test_bodies_that_move_are_sent_with_each_frame_and_once_that_there_are_none(made):
    filled, sent, now = Filled(), [], [0.0]
    delivery = Delivery(filled, lambda *one: sent.append(one), PERIOD, lambda: now[0])

    def calls(frame, clusters):
        """Clusters of the calls that a frame, and some turns after it, have sent."""
        filled.stamp, filled.clusters = frame, clusters
        for _ in range(10):
            now[0] += FOLLOWS
            delivery.run()
        payloads = [payload for kind, payload in sent if kind is Kind.CALL]
        sent.clear()
        found = [read_call(payload) for payload in payloads]
        assert all(one.call == "update_clusters" for one in found)
        numbers.extend(one.number for one in found)
        return [UpdateClusters.model_validate(one.arguments).clusters for one in found]

    numbers, none = [], records(0, Cluster)
    assert calls(1.0, none) == []
    [first] = calls(1.1, moving(0.5))
    [second] = calls(1.2, moving(0.4))
    assert first.tobytes() == moving(0.5).tobytes()
    assert second.tobytes() == moving(0.4).tobytes()
    # No frame came.
    assert calls(1.2, moving(0.3)) == []
    [last] = calls(1.3, none)
    assert len(last) == 0
    assert calls(1.4, none) == []
    # The service does none of them twice.
    assert len(set(numbers)) == 3
    guard = Guard(made, self_test=False)
    UpdateClusters(clusters=second).apply(guard)
    assert guard._watch.clusters[0].number == 7


def test_bodies_that_move_are_not_sent_more_often_than_the_service_takes_calls():
    filled, sent, now = Filled(), [], [1.0]
    delivery = Delivery(filled, lambda *one: sent.append(one), PERIOD, lambda: now[0])
    for k in range(1000):
        now[0] += 0.001
        filled.stamp, filled.clusters = now[0], moving(1e-3 * k)
        delivery.run()
    assert sum(kind is Kind.CALL for kind, _ in sent) <= 1.0 / FOLLOWS + 1
    assert sum(kind is Kind.CALL for kind, _ in sent) >= 0.8 / FOLLOWS


WRONG = {
    "no stream": ("payload", CELLS.pack(0, 1, 1.0)),
    "half a head": ("payload", CELLS.pack(1, 1, 1.0)[:-8]),
    "half a change": ("payload", CELLS.pack(1, 1, 1.0) + bytes(20)),
    "not the first": ("cells_order", CELLS.pack(1, 2, 1.0)),
    "no time": ("cells", CELLS.pack(1, 1, np.nan)),
    "no word": (
        "cells", CELLS.pack(1, 1, 1.0) + CHANGE.pack(bytes(16), 0, 0, -1, 0, 0, 0)
    ),
    "no error": (
        "cells", CELLS.pack(1, 1, 1.0) + CHANGE.pack(bytes(16), 0, np.nan, 1, 0, 0, 0)
    ),
    "no sensor": (
        "cells", CELLS.pack(1, 1, 1.0) + CHANGE.pack(bytes(16), 0, 0, 1, 0, 256, 0)
    ),
}  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG)
def test_changes_that_cannot_be_are_dropped_and_change_nothing(desk, wrong):
    cause, payload = WRONG[wrong]
    assert desk.hear(payload) == cause
    assert desk.stamp == -np.inf and not desk.claims.occupied.words.any()


def test_no_more_changes_are_taken_than_the_guard_may_have_in_a_cycle(desk):
    change = CHANGE.pack(bytes(16), 0.0, 0.0, 1, 0, 0, 0)
    whole, rest = divmod(MOST_IN_A_CYCLE, MOST_CHANGES)
    assert whole > 1 < rest
    for k in range(whole):
        number = k + 1
        assert (
            desk.hear(CELLS.pack(1, number, 1 + 0.1 * k) + MOST_CHANGES * change) == ""
        )
    stamp = 1 + 0.1 * whole
    head = CELLS.pack(1, whole + 1, stamp)
    assert desk.hear(head + (rest + 1) * change) == "busy"
    assert desk.hear(head + rest * change) == ""
    head = CELLS.pack(1, whole + 2, stamp + 0.1)
    assert desk.hear(head + change) == "busy" and desk.stamp == stamp
    desk.mapped.renew()
    assert desk.hear(head + change) == "" and desk.stamp == stamp + 0.1


def test_health_goes_to_all_clients_and_into_the_recording(desk):
    other = SimpleNamespace(sender=9)
    desk.context.peers.here = (desk.peer, other)
    desk.scene = SimpleNamespace(sensors={"top": None, "skin": None})
    notes = []
    desk.note = lambda note, **more: notes.append((note, more))
    row = SENSOR.pack(1, 0, 4, 2, 1.5, b"SILENT: it sends no frames")
    payload = HEALTH.pack(1.5, 4, 2, 4711, 1, 1, 2) + row
    assert desk.hear(payload, kind=Kind.HEALTH) == ""
    assert desk.sent == [payload]
    sensors = notes[0][1]["sensors"]
    says = {"says": "SILENT: it sends no frames", "frees": False, "stamp": 1.5}
    assert sensors == {"skin": says}
    for wrong in (payload[:-1], payload + row, HEALTH.pack(1, 1, 1, 1, 2, 1, 3) + row):
        assert desk.hear(wrong, kind=Kind.HEALTH) == "payload"
    desk.peer.calls_left = 0
    assert desk.hear(payload, kind=Kind.HEALTH) == "busy"
