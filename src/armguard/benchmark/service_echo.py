"""The other end of a bare UDP echo: it answers at once with as much as the service."""

import socket
import sys

from armguard.station.service.machine import ask_realtime
from armguard.station.wire.layout import LEAST, STATE, WISH, command_size

# What goes there and comes back between the service and its client in the bay: a state
# with velocities and a wish of two arms of seven joints, and the answer [bytes].
JOINTS, ROBOTS = 14, 2
ASKED = LEAST + STATE.size + WISH.size + 3 * 8 * JOINTS
ANSWERED = command_size(ROBOTS, JOINTS)


def main() -> None:
    """Answer everything; the first line on standard output is the port.

    With the word `realtime` it asks for real-time scheduling first.
    """
    if "realtime" in sys.argv:
        ask_realtime()
    buffer, answer = bytearray(2 * ANSWERED), bytes(ANSWERED)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as here:
        here.bind(("127.0.0.1", 0))
        sys.stdout.write(f"{here.getsockname()[1]}\n")
        sys.stdout.flush()
        while True:
            _, address = here.recvfrom_into(buffer)
            here.sendto(answer, address)


if __name__ == "__main__":
    main()
