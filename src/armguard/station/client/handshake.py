"""A WELCOME, put together from its parts."""

from armguard.station.client.clock import ServiceClock
from armguard.station.client.welcome import Welcome, read_welcome
from armguard.station.wire.boot import boot_id
from armguard.station.wire.layout import WELCOME


class Handshake:
    """Collects parts of what a service tells about itself.

    Args:
        clock: The service's clock, which is learnt from the round trip.
    """

    def __init__(self, clock: ServiceClock) -> None:
        self._clock = clock
        self._scene = 0
        self._parts: dict[int, bytes] = {}

    def take(self, payload: memoryview, scene: int, now: int) -> Welcome | None:
        """Take a part over; all of it when that was the last one that was missing.

        Args:
            payload: Of the message.
            scene: The scene in its header: parts of another one are given up.
            now: When it came in, on this machine's monotonic clock [ns].
        """
        part, parts, _, _, _, asked, read = WELCOME.unpack_from(payload)
        if scene != self._scene:
            self._scene, self._parts = scene, {}
        self._parts[part] = bytes(payload[WELCOME.size :])
        if asked:
            self._clock.learn(asked, read, now)
        if len(self._parts) < parts:
            return None
        text = b"".join(self._parts[k] for k in range(parts))
        self._parts = {}
        welcome = read_welcome(text)
        if welcome.boot_id and welcome.boot_id == boot_id():
            self._clock.share()
        return welcome
