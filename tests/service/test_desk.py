"""A cycle on the desk, beside the same cycle asked of a guard in Python."""

import struct

import numpy as np
import pytest

from armguard import Guard, Level, Reason, bay_scene
from armguard.recording.frames import Form as FrameForm
from armguard.recording.frames import frame_of
from armguard.recording.ring import RingReader, RingWriter
from armguard.respond import Action
from armguard.respond.command import DRIVEN
from armguard.respond.daqp_interface import FUNCTION
from armguard.service.desk.desk import OUTCOMES
from armguard.service.desk.taking import take_desired_motion, take_state
from armguard.service.server import ServiceSettings
from armguard.service.server.judge import Judge
from armguard.service.wire import Cause, Form
from armguard.service.wire.layout import HAS_VELOCITY, MISSED, MOST
from armguard.service.wire.layout import HAS_WISH as WITH_WISH

N = 14
ME, OTHER, ALL = 7, 2**63 + 5, 0b11
SHOWN = 2**62 + 1
PERIOD = 0.001


class Bench:
    """A judge whose messages are written by hand."""

    def __init__(self, path) -> None:
        settings = ServiceSettings(self_test=False)
        self.ring = RingWriter(path, 8 << 20)
        self.reader = RingReader(path)
        self.buffer = bytearray(MOST + 8)
        self.out = bytearray(MOST)
        self.judge = Judge(
            bay_scene("path"),
            "",
            settings,
            self.ring,
            np.frombuffer(self.buffer, np.float64),
            np.frombuffer(self.out, np.float64),
        )
        self.desk = self.judge.desk
        self.arrival = self.judge.arrival

    def take(self, payload, taker=take_state, sender=ME, sequence=1, now=0, token=0):
        """Hand a payload over; what came of it, and of the desired motion in it."""
        self.buffer[48 : 48 + len(payload)] = payload
        arrival = self.arrival
        arrival.length, arrival.now = 48 + len(payload) + 16, now
        arrival.sender, arrival.sequence = sender, sequence
        arrival.token, arrival.watchdog = token, 10**9
        outcome = OUTCOMES[taker(self.judge.lines)]
        if outcome or taker is take_desired_motion or not arrival.has_desired:
            return outcome, None
        return outcome, OUTCOMES[arrival.desired_outcome]


@pytest.fixture
def bench(tmp_path):
    one = Bench(tmp_path / "ring")
    yield one
    one.ring.close()


def state(q, v=None, bits=ALL, stamp=1.5, desired=b""):
    flags = (HAS_VELOCITY if v is not None else 0) | (WITH_WISH if desired else 0)
    numbers = [*q, *([] if v is None else v)]
    head = struct.pack("<IId", bits, flags, stamp)
    return head + struct.pack(f"<{len(numbers)}d", *numbers) + desired


def desired_motion(values, form=Form.VELOCITIES, token=SHOWN):
    return struct.pack(f"<QII{len(values)}d", token, form, len(values), *values)


def test_states_are_copied_as_they_were_sent(bench):
    rng = np.random.default_rng(0)
    desk = bench.desk
    q, v = np.full(N, np.nan), np.zeros(N)
    stamps, sequences, measured = np.full(2, np.nan), [0, 0], [0, 0]
    for k in range(1, 400):
        bits = int(rng.integers(1, 4))
        own = [r for r in range(2) if bits >> r & 1]
        places = np.concatenate([np.arange(7 * r, 7 * r + 7) for r in own])
        new, speeds = rng.normal(size=(2, len(places)))
        with_speeds = bool(rng.random() < 0.5)
        stamp = float(rng.normal())
        payload = state(new, speeds if with_speeds else None, bits, stamp)
        assert bench.take(payload, sequence=k) == ("", None)
        q[places] = new
        if with_speeds:
            v[places] = speeds
        for r in own:
            stamps[r], sequences[r], measured[r] = stamp, k, int(with_speeds)
        assert desk.q.tobytes() == q.tobytes()
        assert desk.velocity.tobytes() == v.tobytes()
        assert desk.stamps.tobytes() == stamps.tobytes()
        assert desk.sequence.tolist() == sequences
        assert desk.measured.tolist() == measured


def test_a_state_that_is_none_changes_nothing(bench):
    desk = bench.desk
    q, v = np.zeros(N), np.zeros(N)
    bench.take(state(q, v), sequence=5, now=0)
    whole = state(q + 1.0, v + 1.0)
    wrong = {
        b"": "payload",
        whole[:15]: "payload",
        whole[:-8]: "joints",
        whole + bytes(8): "joints",
        state(q[:7] + 1.0, bits=0): "robots",
        state(q[:7] + 1.0, bits=0b100): "robots",
        state(q[:7] + 1.0, bits=1 << 31): "robots",
        state(q + 1.0, bits=0b1): "joints",
        state(q + 1.0, v, desired=bytes(8)): "joints",
    }
    kept = [a.tobytes() for name, a in desk._asdict().items() if name in READ]
    for payload, outcome in wrong.items():
        assert bench.take(payload, sequence=6) == (outcome, None)
        again = [a.tobytes() for name, a in desk._asdict().items() if name in READ]
        assert again == kept, outcome
    taken = bench.take(whole, sender=OTHER, sequence=6, now=10**9 - 1)
    assert taken == ("second_controller", None)
    assert bench.take(whole, sender=OTHER, sequence=6, now=10**9) == ("", None)
    assert desk.sender.view(np.uint64).tolist() == [OTHER, OTHER]
    assert bench.take(whole, sequence=7, now=3 * 10**9) == ("", None)


READ = ("q", "velocity", "stamps", "measured", "sender", "sequence", "heard", "desired")


def test_desired_motion_is_taken_over_or_dropped_by_name(bench):
    desk = bench.desk
    values = np.random.default_rng(1).normal(size=N)

    def take(payload, token=SHOWN):
        return bench.take(payload, take_desired_motion, token=token)[0]

    assert take(desired_motion(values)) == ""
    assert desk.desired.tobytes() == values.tobytes()
    twist = [1.0, *range(6)]
    for payload, outcome in (
        (b"", "payload"),
        (desired_motion(values)[:-8], "payload"),
        (desired_motion(values) + bytes(8), "payload"),
        (desired_motion(values, form=9), "payload"),
        (desired_motion(values[:7]), "joints"),
        (desired_motion(values, token=SHOWN + 1), "not_commander"),
        (desired_motion([*values[:13], np.nan]), "wish_not_finite"),
        (desired_motion([*values[:13], np.inf], Form.POSITIONS), "wish_not_finite"),
        (desired_motion(twist[:6], Form.TWISTS), "joints"),
        (desired_motion([0.5, *twist[1:]], Form.TWISTS), "joints"),
        (desired_motion([-1.0, *twist[1:]], Form.TWISTS), "joints"),
        (desired_motion([1e6, *twist[1:]], Form.TWISTS), "joints"),
        (desired_motion(9 * twist, Form.TWISTS), "joints"),
    ):
        assert take(payload) == outcome, (payload, outcome)
        assert desk.desired.tobytes() == values.tobytes()
    assert take(desired_motion(values), token=0) == "not_commander"
    # Invalid desired motion in a state does not keep the measurement from counting.
    measured = np.full(N, 0.25)
    payload = state(measured, desired=desired_motion(values, token=3))
    assert bench.take(payload, token=SHOWN) == ("", "not_commander")
    assert (desk.q == measured).all()
    # Of two twists for one tool the later one counts.
    first, later = [0.0, *range(6)], [0.0, *range(6, 12)]
    assert take(desired_motion([*first, *twist, *later], Form.TWISTS)) == ""
    rows = [[row.tool, *row.twist] for row in desk.twists[:2]]
    assert rows == [later, twist]


def desired_at(form, k, q):
    """What is desired in a cycle, and the same for `Guard.filter` and its like."""
    if form is Form.VELOCITIES:
        values = np.sin(0.01 * k + np.arange(N))
        return values, values
    if form is Form.POSITIONS:
        values = q + 0.002 * np.cos(0.01 * k + np.arange(N))
        return values, values
    twists = {"left": np.full(6, 0.05), "right": np.linspace(-0.1, 0.1, 6)}
    rows = np.concatenate([[r, *t] for r, t in enumerate(twists.values())])
    return rows, twists


@pytest.mark.parametrize("form", list(Form))
@pytest.mark.parametrize("solver", ["compiled", "python"])
def test_the_desk_gives_the_very_bits_of_a_guard(bench, form, solver):
    guard = Guard(bay_scene("path"), self_test=False)
    judge, cycle = bench.judge, bench.judge.cycle
    if solver == "python":
        # As on a machine where kernels cannot call the solver.
        for one in (guard, judge.guard.guard):
            one._response.solver[FUNCTION] = 0
    list(bench.reader.unread())
    asks = {
        Form.VELOCITIES: guard.filter,
        Form.POSITIONS: guard.filter_positions,
        Form.TWISTS: guard.filter_twists,
    }
    q, v = guard.home, np.zeros(N)
    seen = set()
    for k in range(300):
        start = 10**12 + k * int(PERIOD * 1e9)
        now = start * 1e-9
        values, same = desired_at(form, k, q)
        # A tenth of the states come without velocities; one cycle is a stop.
        measured = v if k % 10 else None
        payload = state(q, measured, stamp=now, desired=desired_motion(values, form))
        assert bench.take(payload, sequence=k + 1, token=SHOWN) == ("", "")
        cause = Cause.STOP_ORDERED if k == 250 else Cause.NONE
        cycle.number, cycle.start, cycle.ended = k, start, start + 5
        cycle.cause, cycle.marks, cycle.began_at = cause, 2, start - 9
        cycle.began_by = cycle.commander = ME
        cycle.began_with = k + 1
        judge.ask(cause)
        if cause:
            command = guard.stop(q, now, velocity=measured, now=now)
        else:
            command = asks[form](q, same, now, velocity=measured, now=now)
        last = judge.last
        assert last.numbers.tobytes() == command.numbers.tobytes()
        assert last.verdict.numbers.tobytes() == command.verdict.numbers.tobytes()
        assert bytes(bench.out[48:])[: size_of(2)] == packed(
            command, guard, k, start, form
        )
        judge.write_down()
        frame = frame_of(next(bench.reader.unread()))
        expected = FrameForm.STOP if cause else FrameForm(form)
        assert frame.form is expected
        assert frame.now == now
        assert frame.received == (start - 9) * 1e-9
        assert frame.q.tobytes() == q.tobytes()
        assert (frame.velocity is None) == (measured is None)
        assert frame.told.tobytes() == command.numbers.tobytes()
        assert frame.verdict.tobytes() == command.verdict.numbers.tobytes()
        assert frame.poses.tobytes() == guard.poses.tobytes()
        if form is Form.TWISTS and not cause:
            assert frame.text["tools"] == ["left", "right"]
            assert (frame.asked == np.concatenate(list(same.values()))).all()
        else:
            assert (frame.asked == (Reason.STOP_ORDERED if cause else same)).all()
        seen.add(command.verdict.level)
        v = np.array(command.velocity)
        q = q + v * PERIOD
    assert Level.STOP in seen
    assert len(seen) >= 2


def size_of(robots):
    return 136 + 24 + 48 * robots + 16 * N


def packed(command, guard, k, start, form):
    """The payload of a COMMAND, packed from what a command and a verdict say."""
    verdict = command.verdict
    numbers = verdict.numbers
    bodies = list(dict.fromkeys(guard.tables.body_names))
    head = struct.pack(
        "<QQQqqdd", k, ME, k + 1, start - 9, start + 5, start * 1e-9, verdict.headroom.m
    )
    head += struct.pack("<d", numbers[18])
    if verdict.nearest is None:
        head += struct.pack("<IIdd6d", 2**32 - 1, 2**32 - 1, np.inf, np.inf, *[0.0] * 6)
    else:
        pair = verdict.nearest
        row = 32 + 2 * 17 + N + 20 * int(numbers[4])
        head += struct.pack(
            "<IIdd6d",
            bodies.index(pair.a),
            bodies.index(pair.b),
            pair.distance,
            pair.headroom,
            *numbers[row + 10 : row + 16],
        )
    levels = verdict.levels
    reason = verdict.reason
    level = max(reason.level, *levels.values())
    cause = Cause.STOP_ORDERED if k == 250 else Cause.NONE
    form = FrameForm.STOP if cause else form
    actions = command.actions
    head += struct.pack(
        "<8HQ", reason, cause, level, max(actions.values()), 2, N, 2, form, ME
    )
    for r, part in enumerate(guard.tables.robots):
        row = numbers[32 + 17 * r :]
        phase = command.numbers[4 * N + 2 + r]
        since = command.numbers[4 * N + 4 + r]
        expected = Action.FOLLOW if phase in [int(p) for p in DRIVEN] else Action.STOP
        assert actions[part.name] is (expected if np.isnan(since) else Action.HOLD)
        head += struct.pack(
            "<4H2fdQQd",
            levels[part.name],
            actions[part.name],
            command.blocked[part.name],
            int(row[4]),
            row[2],
            row[5],
            row[3],
            ME,
            k + 1,
            since,
        )
    return head + command.velocity.tobytes() + command.position.tobytes()


def test_what_is_found_out_late_is_reported_again(bench):
    judge, cycle = bench.judge, bench.judge.cycle
    q = judge.guard.guard.home
    for k in range(2):
        start = 10**12 + k * 10**6
        stamp, desired = start * 1e-9, desired_motion(np.full(N, 0.01))
        payload = state(q, np.zeros(N), stamp=stamp, desired=desired)
        assert bench.take(payload, sequence=k + 1, token=SHOWN) == ("", "")
        cycle.number, cycle.start, cycle.cause, cycle.marks = k, start, Cause.NONE, 0
        judge.ask(Cause.NONE)
    velocities = slice(48 + 136 + 24 + 96, 48 + 136 + 24 + 96 + 8 * N)
    assert np.frombuffer(bench.out[velocities], np.float64).any()
    cycle.cause, cycle.marks = Cause.DEADLINE_MISSED, MISSED
    judge.rewrite_answer()
    assert not np.frombuffer(bench.out[velocities], np.float64).any()
    summary = struct.unpack_from("<8HQ", bench.out, 48 + 136)
    assert summary[:5] == (
        Reason.OK, Cause.DEADLINE_MISSED, Level.STOP, Action.STOP, MISSED
    )  # fmt: skip
