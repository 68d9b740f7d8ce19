"""A reflex as a real process, with one sensor and one listener in the test itself."""

import json
import signal
import socket
import struct
import subprocess
import sys
import time
import zlib
from hashlib import blake2s

from armguard.processes import free_port

KEY, RESET_KEY = "a key of pulses ", "a key of resets "
SENSOR, ZONES, THRESHOLD = 7, 16, 100

# Longest wait for an answer on a busy machine [s].
PATIENCE = 20.0

# The bytes of docs/reflex.md, written down once more.
FRAME = struct.Struct("<4sHHIIq")
PULSE = struct.Struct("<4sHHQQqIHHII16s")
FIELDS = ("magic", "version", "trip", "session", "number", "stamp", "stops", "sensor")
FIELDS += ("zone", "distance", "dropped", "seal")


def clear(count=ZONES):
    """Zones that see a wall; no two calls give the same."""
    clear.turn += 1
    return [(400 + clear.turn % 7 + k, 0) for k in range(count)]


clear.turn = 0


def frame(counter, stamp, zones, sensor=SENSOR):
    """A frame, built without the package."""
    rows = b"".join(struct.pack("<HBB", *zone, 0) for zone in zones)
    body = FRAME.pack(b"AGGZ", sensor, len(zones), counter, 0, stamp) + rows
    return body + struct.pack("<I", zlib.crc32(body))


def pulse_bytes(trip, stamp, key=KEY):
    """A pulse, built without the package."""
    body = PULSE.pack(b"AGRX", 1, trip, 5, 6, stamp, 7, SENSOR, 3, 80, 0, b"")[:-16]
    return body + blake2s(body, key=key.encode(), digest_size=16).digest()


class Rack:
    """A running reflex.

    Args:
        folder: Where its file goes.
        settings: Other settings of the sensor.
        more: Other keys of the file.
    """

    def __init__(self, folder, *, more=None, **settings):
        self.line, self.file = folder / "line", folder / "reflex.json"
        self.log = folder / "log"
        self.listener = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.listener.bind(("127.0.0.1", 0))
        self.listener.settimeout(PATIENCE)
        sensor = {
            "id": SENSOR,
            "timeout": 1.0,
            "thresholds": [0.001 * THRESHOLD] * ZONES,
        }
        given = {
            "port": free_port(),
            "key": KEY,
            "reset": RESET_KEY,
            "listeners": [
                self.listener.getsockname()[1],
                *(free_port() for _ in "abc"),
            ],
            "line": str(self.line),
            "sensors": {"ring": sensor | settings},
        }
        self.given = given | (more or {})
        self.file.write_text(json.dumps(self.given))
        self.file.chmod(0o600)
        self.out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.to = ("127.0.0.1", self.given["port"])
        self.counter = 0

    def __enter__(self):
        words = [sys.executable, "-m", "armguard.reflex", str(self.file)]
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(words, stderr=log)
        try:
            self.until(lambda pulse: pulse["trip"] == 1)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGCONT)
        self.process.kill()
        self.process.wait()
        self.listener.close()
        self.out.close()

    def start_sensor(self, period=0.02):
        """Have a process be the sensor."""
        words = ("armguard.chaos.zone_sensor", str(self.file), "ring")
        words = (*words, "--period", str(period))
        return subprocess.Popen([sys.executable, "-m", *words])

    def send(self, zones=None, *, counter=None, stamp=None, **more):
        """Send a frame."""
        self.counter = self.counter + 1 if counter is None else counter
        stamp = time.monotonic_ns() if stamp is None else stamp
        self.raw(frame(self.counter, stamp, zones or clear(), **more))

    def raw(self, data):
        self.out.sendto(data, self.to)

    def pulse(self):
        """The next pulse."""
        return dict(zip(FIELDS, PULSE.unpack(self.listener.recv(4096)), strict=True))

    def until(self, done):
        """The first pulse that is as it is to be."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            if done(pulse := self.pulse()):
                return pulse
        raise AssertionError(f"no such pulse; the last one was {pulse}")

    def stays(self, trip, seconds=0.1):
        """Every pulse says the same for a while."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            assert self.pulse()["trip"] == trip

    def lift(self):
        """Reset the reflex, which must succeed.

        A busy machine may let the sensor's timeout pass between frame and reset. As an
        operator would, it then tries again.
        """
        from armguard.service.wire.pulses import reset

        end = time.monotonic() + PATIENCE
        self.send()
        while reason := reset(self.file, PATIENCE):
            if time.monotonic() > end:
                raise AssertionError(reason)
            self.send()
        self.until(lambda pulse: pulse["trip"] == 0)
