"""Mistakes of clients of a service.

A function plays a client of a service of the bay; the answer is what it raises, the
refusal that the service sends, or the `why` of the last cycle.
"""

import numpy as np

from messages import JOINTS, Forger
from mistakes.mistake import Mistake

# Positions of the bay's arms that can only be degrees, and the joint named first.
IN_DEGREES = np.r_[90.0, np.zeros(JOINTS - 1)]


def led(send, motion):
    """A desired motion that a commander repeats until the service names its unit."""

    def play(client, arms):
        arms.drive(np.zeros(JOINTS), 2)
        client.refusal = None

        def named(_):
            getattr(client, send)(motion)
            return client.refusal is not None and client.refusal[0] == "unit"

        arms.measure_until(named)
        return client.refusal[1]

    return play


def refused(message):
    """The refusal of a message that a forger has made."""

    def play(client, arms):
        client.claim()
        client.refusal = None
        forger = Forger(client)
        forger.send(message(forger))
        client.call("ping")
        return client.refusal[1]

    return play


def called(call, **arguments):
    """What a call of a client raises."""

    def play(client, arms):
        client.claim()
        return client.call(call, **arguments)

    return play


def measured(stamp):
    """The sentence of a cycle with a stamp; `stamp` is given the service's clock."""

    def play(client, arms):
        arms.drive(np.zeros(JOINTS), 2)
        number = client.send_state(arms.q, arms.velocity, stamp(client.clock()))
        while not client.receive(1.0).answers(client.sender, number):
            pass
        return client.call("why")["why"]

    return play


MESSAGES = {
    "desired degrees": Mistake(
        *("is 90", "q_desired of joint 'left/joint1'", "give radians"),
        led("send_positions", IN_DEGREES),
        logged=True,
    ),
    "desired degrees a second": Mistake(
        *("is 90 rad/s", "v_desired of joint 'left/joint1'", "give rad/s: 1.571"),
        led("send_velocities", IN_DEGREES),
        logged=True,
    ),
    "a twist in millimetres a second": Mistake(
        *("is 150 m/s", "the twist of robot 'left'", "give m/s: 0.15"),
        led("send_twists", {"left": [0, 0, 150, 0, 0, 0]}),
        logged=True,
    ),
    "a desired NaN": Mistake(
        *("is nan", "number 4, of 'left/joint4'", "send finite numbers"),
        refused(lambda forger: forger.desired(np.r_[0, 0, 0, np.nan, np.zeros(10)])),
    ),
    "too few desired velocities": Mistake(
        *("13 numbers", "the scene has 14 joints", "send a number for each of `names`"),
        refused(lambda forger: forger.desired(np.zeros(13))),
    ),
    "too few positions": Mistake(
        *("13 numbers", "14 positions of its robots", "a number for each of `names`"),
        refused(lambda forger: forger.state(joints=13)),
    ),
    "robots that are not there": Mistake(
        *("the bits 0x7", "the scene has 2 robots", "set a bit for each robot"),
        refused(lambda forger: forger.state(bits=7)),
    ),
    "a call that is no JSON": Mistake(
        *("no JSON", "a call", "send an id, a call and its arguments"),
        refused(lambda forger: forger.call(b'{"id": 1, "call')),
    ),
    "a stamp of another clock": Mistake(
        *(" ms)", "'left'", "of the same clock"), measured(lambda now: now + 1.7e9)
    ),
    "a stamp in milliseconds": Mistake(
        *(" ms)", "'left'", "give stamp and now in seconds"),
        measured(lambda now: 1e3 * now),
    ),
    "no stamp": Mistake(
        *("no finite stamp", "'left'", "pass the time of the measurement"),
        measured(lambda now: np.nan),
    ),
    "too few numbers in Python": Mistake(
        *(
            "shape (13,)",
            "the desired motion",
            "one for each joint, in the order of Welcome.n",
        ),
        lambda client, arms: client.send_positions(np.zeros(13)),
    ),
    "text for positions": Mistake(
        *("'abc'", "q is", "it must be real numbers"),
        lambda client, arms: client.send_state("abc"),
    ),
    "text for a stamp": Mistake(
        *("'now'", "stamp is", "it must be a number [s]"),
        lambda client, arms: client.send_state(arms.q, stamp="now"),
    ),
    "a state of another robot": Mistake(
        *("'panda'", "the scene has no robot", "known names are 'left', 'right'"),
        lambda client, arms: client.send_state(arms.q, robots="panda"),
    ),
    "a twist of another tool": Mistake(
        *("'hand'", "the scene has no tool", "known names are 'left', 'right'"),
        lambda client, arms: client.send_twists({"hand": [0] * 6}),
    ),
    "five numbers of a twist": Mistake(
        *("shape (5,)", "the twist of 'left'", "one for each of vx, vy, vz, wx, wy"),
        lambda client, arms: client.send_twists({"left": [0] * 5}),
    ),
    "another call": Mistake(
        *("'engag'", "there is no call", "did you mean 'engage'"), called("engag")
    ),
    "another robot to engage": Mistake(
        *("'panda'", "no robot is named", "known names are 'left', 'right'"),
        called("engage", name="panda"),
    ),
    "another argument": Mistake(
        *("robot", "call 'engage'", "takes name, ordered"),
        called("engage", robot="left"),
    ),
    "millimetres of a contact": Mistake(
        *("is 2 m", "may touch 'right/link6': depth", "give metres: 0.002"),
        called("allow", a="left/link6", b="right/link6", depth=2.0),
    ),
}
