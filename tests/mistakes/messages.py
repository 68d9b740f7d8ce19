"""Mistakes of clients of a service.

A function plays a client of a service of the bay; the answer is what it raises, the
refusal that the service sends, the `why` of the last cycle, or what the client writes
to its log.
"""

import time

import numpy as np

from armguard import Pose
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


def seen(**arguments):
    """What `place` raises, or the warning of the client, or the next cycle's sentence.

    Values are given the client. The ball is removed then.
    """

    def play(client, arms):
        client.claim()
        arms.measure()
        given = {
            "name": "ball",
            "pose": Pose(xyz=(1, 0, 2.2)),
            "stamp": client.clock(),
            **{
                name: value(client) if callable(value) else value
                for name, value in arguments.items()
            },
        }
        try:
            client.call("place", **given)
            arms.measure()
            return client.call("why")["why"]
        finally:
            client.call("remove", name="ball")

    return play


def measured_as(q=None, velocity=None):
    """The sentence of a cycle with other positions or velocities, by functions."""

    def play(client, arms):
        arms.drive(np.zeros(JOINTS), 2)
        # The first one jumps.
        for _ in range(3):
            number = client.send_state(
                arms.q if q is None else q(arms.q),
                arms.velocity if velocity is None else velocity(arms.velocity),
            )
            while not client.receive(1.0).answers(client.sender, number):
                pass
        return client.call("why")["why"]

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
    "degrees of a measurement": Mistake(
        *("is at -20.05", "joint 'left/joint2'", "give radians"),
        measured_as(q=np.degrees),
    ),
    "degrees a second of a measurement": Mistake(
        *("at 57.00 a second", "joint 'left/joint1'", "check its unit, rad/s"),
        measured_as(velocity=lambda v: v + np.r_[57.0, np.zeros(JOINTS - 1)]),
    ),
    "a measured NaN": Mistake(
        *("is at nan", "joint 'left/joint1'", "check the sensor"),
        measured_as(q=lambda q: q + np.r_[np.nan, np.zeros(JOINTS - 1)]),
    ),
    "a stamp that goes back": Mistake(
        *(" ms)", "'left'", "older than the one before; check the clocks"),
        measured(lambda now: now - 1.0),
    ),
    "no positions": Mistake(
        *("shape ()", "q has", "it must be (14,), one for each joint"),
        lambda client, arms: client.send_state(None),
    ),
    "flags for positions": Mistake(
        *("[True, True", "q is", "it must be real numbers"),
        lambda client, arms: client.send_state([True] * JOINTS),
    ),
    "positions by robot": Mistake(
        *("{'left'", "q is", "it must be real numbers"),
        lambda client, arms: client.send_state({"left": [0.0] * 7}),
    ),
    "the number of a robot": Mistake(
        *("is 0", "a robot", "it must be text"),
        lambda client, arms: client.send_state(arms.q, robots=0),
    ),
    "no desired motion": Mistake(
        *("shape ()", "the desired motion", "it must be (14,), one for each joint"),
        lambda client, arms: client.cycle(arms.q, None, arms.velocity),
    ),
    "a twist without its tool": Mistake(
        *("array([0.", "the desired motion", "give a twist by tool, such as {'left'"),
        lambda client, arms: client.send_twists(np.zeros(6)),
    ),
    "a number for a call": Mistake(
        *("is 5", "a call", "it must be text"),
        lambda client, arms: client.call(5),
    ),
    "a missing argument": Mistake(
        *("'robot' is missing", "call 'grasp'", "takes robot, name"), called("grasp")
    ),
    "a number for a robot": Mistake(
        *("is 5", "name", "it must be a valid string"), called("engage", name=5)
    ),
    "a set of names": Mistake(
        *("{'left'} is a set", "call 'engage'", "give numbers, text, a Pose"),
        called("engage", name={"left"}),
    ),
    "milliseconds of an expiry": Mistake(
        *("for ", "'left/link6' may touch 'right/link6'", "give until in seconds"),
        lambda client, arms: called(
            "allow", a="left/link6", b="right/link6", until=1e3 * client.clock()
        )(client, arms),
        logged=True,
    ),
    "millimetres of a region": Mistake(
        *("500 m look", "Region size", "give metres: 0.5"),
        called(
            *("allow",),
            a="left/link6",
            b="right/link6",
            region={"size": [500, 500, 500], "xyz": [0, 0, 0]},
        ),
    ),
    "degrees of a region": Mistake(
        *("is 90 rad", "rpy[2]", "give radians: 1.5708"),
        called(
            *("allow",),
            a="left/link6",
            b="right/link6",
            region={"size": [1, 1, 1], "xyz": [0, 0, 0], "rpy": [0, 0, 90]},
        ),
    ),
    "degrees of a retreat": Mistake(
        *("go to -20.0000", "joint 'left/joint2'", "give radians"),
        called("retreat", name="left", to=[0, -20, 0, 97, 0, 72, 0]),
    ),
    "millimetres of a place": Mistake(
        *("800 m look", "object 'ball': pose", "give metres: 0.8"),
        seen(pose=Pose(xyz=(800, 0, 0))),
        logged=True,
    ),
    "millimetres of a new shape": Mistake(
        *("50 m look", "object 'ball'", "give metres: 0.05"),
        seen(shape={"kind": "sphere", "radius": 50.0}),
        logged=True,
    ),
    "millimetres a second of an object": Mistake(
        *("500.000 m/s", "object 'ball'", "give m/s: 0.5"), seen(velocity=[500, 0, 0])
    ),
    "a pose as seven numbers": Mistake(
        *("shape (7,)", "object 'ball': pose", "give a Pose or a transform (4, 4)"),
        seen(pose=[1, 0, 2.2, 0, 0, 0, 1]),
    ),
    "a rotation that is none": Mistake(
        *("det R is 0.125", "object 'ball': pose", "give a Pose or a transform"),
        seen(pose=np.diag([0.5, 0.5, 0.5, 1.0])),
    ),
    "text for a pose": Mistake(
        *("is 'here'", "pose", "it must be numbers"), seen(pose="here")
    ),
    "a shape that is not there": Mistake(
        *("'spher'", "there is no kind", "did you mean 'sphere'?"),
        seen(shape={"kind": "spher", "radius": 0.1}),
    ),
    "a sighting of another clock": Mistake(
        *(" s,", "'ball' was seen at", "give seconds of that clock"),
        seen(stamp=lambda client: time.time()),
    ),
    "an old sighting": Mistake(
        *(" s ago", "object 'ball'", "give the stamp of a newer sighting"),
        seen(stamp=lambda client: client.clock() - 10.0),
        logged=True,
    ),
    "no stamp of a sighting": Mistake(
        *("moves", "object 'ball'", "give the stamp of its sighting [s]"),
        seen(stamp=None),
    ),
    "another object": Mistake(
        *("'bal'", "no fixed object is named", "did you mean 'ball'?"),
        called("remove", name="bal"),
    ),
    "a fixture": Mistake(
        *("is a fixture", "'bench'", "needs the key for 'administer'"),
        called("remove", name="bench"),
    ),
}
