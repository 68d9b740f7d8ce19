"""Mistakes in how a client is made, waits and shares the service with other clients."""

from math import nan

import numpy as np

from armguard import Client
from armguard.service.wire import Role
from messages import JOINTS
from mistakes.mistake import Mistake


def opened(**settings):
    """What a client with other settings raises."""

    def play(client, arms):
        with Client(**{"port": client.port, **settings}) as other:
            other.connect(2.0)

    return play


def of_another(send, role=Role.COMMAND, **arguments):
    """What a call of another client raises, or the refusal of its message."""

    def play(client, arms):
        arms.drive(np.zeros(JOINTS), 2)
        with Client(client.port, role=role, name="second") as other:
            other.connect(20.0)
            arguments_now = {
                name: value(client, arms) for name, value in arguments.items()
            }
            getattr(other, send)(**arguments_now)
            other.call("ping")
            return other.refusal[1]

    return play


CLIENTS = {
    "milliseconds of a watchdog": Mistake(
        *("is 100 s", "watchdog", "give seconds: 0.1"), opened(watchdog=100)
    ),
    "a watchdog of NaN": Mistake(
        *("is nan", "watchdog", "it must be a number [s]"), opened(watchdog=nan)
    ),
    "no watchdog": Mistake(
        *("is 0 s", "watchdog", "it must be finite and > 0"), opened(watchdog=0)
    ),
    "milliseconds to wait for an answer": Mistake(
        *("is 50 s", "timeout", "give seconds: 0.05"),
        lambda client, arms: client.cycle(arms.q, 0 * arms.q, timeout=50),
    ),
    "milliseconds to wait for a reply": Mistake(
        *("is 3000 s", "timeout", "give seconds: 3"),
        lambda client, arms: client.call("why", timeout=3000),
    ),
    "text for a time": Mistake(
        *("'1'", "timeout", "it must be a number [s]"),
        lambda client, arms: client.receive("1"),
    ),
    "text for a port": Mistake(
        *("'47800'", "port", "a whole number from 1 to 65535"), opened(port="47800")
    ),
    "another port": Mistake(
        *("port 1 ", "no service of this user runs", "pass its keys"), opened(port=1)
    ),
    "text for a role": Mistake(
        *("'command'", "role", "one of Role.OBSERVE, Role.SENSE"),
        opened(role="command"),
    ),
    "no file of keys": Mistake(
        *("/none", "cannot read keys", "give the file that the service has written"),
        opened(keys="/none"),
    ),
    "a number for a name": Mistake(
        *("is 5", "name", "it must be text"), opened(name=5)
    ),
    "a fraction of a cycle": Mistake(
        *("1.5", "every", "it must be a whole number from 0"), opened(every=1.5)
    ),
    "a client that did not connect": Mistake(
        *("not connected", "call connect()", "first"),
        lambda client, arms: Client(client.port).stop(),
    ),
    "a client that receives before it connects": Mistake(
        *("not connected", "call connect()", "first"),
        lambda client, arms: Client(client.port).receive(),
    ),
    "a second controller": Mistake(
        *("a robot that another", "controller has", "stop that one first"),
        of_another("send_state", q=lambda client, arms: arms.q),
    ),
    "a second commander": Mistake(
        *("client ", "has the command", "wait until it gives it back"),
        of_another("claim"),
    ),
    "a commander that did not claim": Mistake(
        *("a desired motion", "a client that does not command", "claim the command"),
        of_another("send_velocities", velocities=lambda client, arms: 0 * arms.q),
    ),
    "an observer that commands": Mistake(
        *("'observe'", "the key for 'command'", "may claim the command"),
        of_another("claim", Role.OBSERVE),
    ),
    "an observer that measures": Mistake(
        *("a kind of message", "the sender's key", "use another key"),
        of_another("send_state", Role.OBSERVE, q=lambda client, arms: arms.q),
    ),
}
