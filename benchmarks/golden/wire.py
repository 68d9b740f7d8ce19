"""Plays through the service's own cycle: messages in, the bytes of its answers out."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from armguard.recording.ring import RingWriter
from armguard.scene import bay_scene
from armguard.service.desk.taking import take_state
from armguard.service.server import ServiceSettings
from armguard.service.server.judge import Judge
from armguard.service.wire import Cause, Form
from armguard.service.wire.layout import HAS_VELOCITY, HAS_WISH, MOST
from golden.fields import parts_of

Floats = NDArray[np.float64]

# Sizes of header and seal of a payload [bytes], and of a recording in memory.
HEAD, SEAL, RING = 48, 16, 8 << 20

PERIOD, ME, TOKEN_OF_ME, BEGIN = 0.004, 7, 2**62 + 1, 10**12


@dataclass(frozen=True)
class WirePlay:
    """A play through the service's cycle.

    Attributes:
        name: Its name.
        form: Form of the motion that the operator desires.
        cycles: How many cycles.
        seed: Of all that is drawn.
    """

    name: str
    form: Form
    cycles: int = 400
    seed: int = 0

    def run(self) -> Iterator[dict[str, bytes]]:
        """Every cycle's bytes by field."""
        with TemporaryDirectory() as folder:
            yield from self.cycles_in(Path(folder))

    def cycles_in(self, folder: Path) -> Iterator[dict[str, bytes]]:
        """The same, with a ring in a folder."""
        rng = np.random.default_rng([self.seed, 23])
        scene = bay_scene("path")
        scene.period = PERIOD
        ring = RingWriter(folder / "ring", RING)
        message, answer = bytearray(MOST + 8), bytearray(MOST)
        judge = Judge(
            scene,
            "",
            ServiceSettings(self_test=False),
            ring,
            np.frombuffer(message, np.float64),
            np.frombuffer(answer, np.float64),
        )
        guard, arrival, cycle = judge.guard.guard, judge.arrival, judge.cycle
        arrival.sender = cycle.began_by = cycle.commander = ME
        arrival.token, arrival.watchdog = TOKEN_OF_ME, 10**9
        cycle.marks = 2
        q, v = guard.home, np.zeros_like(guard.home)
        desired = np.zeros_like(q)
        for k in range(self.cycles):
            if k % 100 == 0:
                desired = rng.uniform(-0.6, 0.6, len(q))
                guard.engage()
            start = BEGIN + k * int(PERIOD * 1e9)
            payload = struct.pack(
                "<IId", 0b11, HAS_WISH | (HAS_VELOCITY if k % 9 else 0), start * 1e-9
            )
            measured = q + rng.uniform(-2e-5, 2e-5, len(q))
            if k % 131 == 130:
                measured[3] = np.nan
            payload += measured.tobytes() + (v.tobytes() if k % 9 else b"")
            asked = self.asked(q, desired)
            payload += struct.pack("<QII", TOKEN_OF_ME, self.form, len(asked))
            payload += asked.tobytes()
            message[HEAD : HEAD + len(payload)] = payload
            arrival.length, arrival.now = HEAD + len(payload) + SEAL, start
            arrival.sequence = cycle.began_with = k + 1
            take_state(judge.lines)
            cause = Cause.STOP_ORDERED if k % 170 == 169 else Cause.NONE
            cycle.number, cycle.start, cycle.ended = k, start, start + 5
            cycle.cause, cycle.began_at = cause, start
            judge.ask(cause)
            command = judge.last
            assert command is not None
            found = parts_of(command.verdict, command)
            found["wire.answer"] = bytes(answer)
            yield found
            v = np.array(command.velocity)
            q = q + v * PERIOD
        ring.close()

    def asked(self, q: Floats, desired: Floats) -> Floats:
        """What the operator's message holds."""
        if self.form is Form.POSITIONS:
            return q + desired * PERIOD
        if self.form is Form.TWISTS:
            return np.concatenate([[r, *(0.2 * desired[:6])] for r in (0.0, 1.0)])
        return desired


WIRE = (
    WirePlay("wire velocities", Form.VELOCITIES),
    WirePlay("wire positions", Form.POSITIONS, seed=1),
    WirePlay("wire twists", Form.TWISTS, seed=2),
)
