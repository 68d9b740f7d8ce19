"""All faults, a row each: the injection, and what is declared to happen.

`armguard chaos` prints this table, tests play each row, and docs/chaos.md has it.
"""

from collections.abc import Callable

from armguard.chaos import doors, injections, tampering
from armguard.chaos.fault import Effect, Fault, Injection
from armguard.chaos.injections import tampered
from armguard.chaos.playground import Playground
from armguard.chaos.reflex_faults import HELD_UP, REFLEX_FAULTS
from armguard.chaos.sensor_faults import SENSOR_FAULTS
from armguard.chaos.tampering import COMMANDS, DESIRED, STATES, on, rewritten
from armguard.geometry.pose import Pose
from armguard.service.wire import Kind, Seal

GOES_ON, RESTS = Effect.GOES_ON, Effect.RESTS
STOPS, STOPS_ITSELF = Effect.STOPS, Effect.STOPS_ITSELF
REPORTED_ONLY = Effect.REPORTED_ONLY

# How the guard says that no state came: by its age, or by the cycle that waited for it.
NO_STATE = ("STATE_STALE", "CYCLE_LATE")
WITHIN_STALE = ("stale", "cycle")

# How it says that velocities and positions contradict each other.
CONTRADICTS = ("STATE_DISAGREES", "NOT_FOLLOWED")


def states(change: Callable[[bytes], tampering.Handed]) -> Injection:
    """Something is done to the messages of the controller."""
    return tampered(lambda _: on(STATES, change))


def edited(edit: Callable[[bytearray], None]) -> Injection:
    """The controller says something else, well sealed."""
    return tampered(lambda ground: on(STATES, rewritten(ground.seal, edit)))


def fresh(
    make: Callable[[Playground], Callable[[bytes], tampering.Handed]],
) -> Injection:
    """As `states`, made anew each time it is played."""
    return tampered(lambda ground: on(STATES, make(ground)))


MESSAGES = "messages of the controller"
CONTENT = "what the controller says"
COMMANDER = "the commander"
STRANGERS = "other clients"
ANSWERS = "answers"
DOORS = "the page, Zenoh and files"
PROCESSES = "processes"

FAULTS: tuple[Fault, ...] = (
    Fault(
        name="late by 2 ms", group=MESSAGES, effect=GOES_ON,
        inject=states(tampering.late(0.002)),
    ),
    Fault(
        name="late by 300 ms", group=MESSAGES, effect=STOPS, reasons=NO_STATE,
        within=WITHIN_STALE, inject=states(tampering.late(0.3)),
    ),
    Fault(
        name="1 % lost", group=MESSAGES, effect=GOES_ON, hold=1.0,
        inject=fresh(lambda _: tampering.lost_sometimes(0.01)),
    ),
    Fault(
        name="all lost", group=MESSAGES, effect=STOPS, reasons=NO_STATE,
        within=WITHIN_STALE, inject=states(tampering.lost),
    ),
    Fault(
        name="doubled", group=MESSAGES, effect=GOES_ON, counts=("dropped_replayed",),
        inject=states(tampering.doubled),
    ),
    Fault(
        name="reordered", group=MESSAGES, effect=GOES_ON,
        counts=("dropped_out_of_order",),
        inject=fresh(lambda _: tampering.reordered(0.006)),
    ),
    Fault(
        name="old ones replayed", group=MESSAGES, effect=GOES_ON,
        counts=("dropped_out_of_order",),
        inject=fresh(lambda _: tampering.replayed(20)),
    ),
    Fault(
        name="nothing but old ones", group=MESSAGES, effect=STOPS, reasons=NO_STATE,
        within=WITHIN_STALE, counts=("dropped_replayed",),
        inject=fresh(lambda _: tampering.only_the_first()),
    ),
    Fault(
        name="bits turned round", group=MESSAGES, effect=STOPS, reasons=NO_STATE,
        within=WITHIN_STALE, counts=("dropped_seal",),
        inject=fresh(lambda _: tampering.corrupted()),
    ),
    Fault(
        name="cut short", group=MESSAGES, effect=STOPS, reasons=NO_STATE,
        within=WITHIN_STALE, counts=("dropped_length", "dropped_too_short"),
        inject=fresh(lambda _: tampering.cut()),
    ),
    Fault(
        name="something behind them", group=MESSAGES, effect=STOPS, reasons=NO_STATE,
        within=WITHIN_STALE, counts=("dropped_length",),
        inject=states(tampering.grown),
    ),
    Fault(
        name="spliced", group=MESSAGES, effect=STOPS, reasons=NO_STATE,
        within=WITHIN_STALE, counts=("dropped_seal",),
        inject=fresh(lambda _: tampering.spliced()),
    ),
    Fault(
        name="sealed with another key", group=MESSAGES, effect=STOPS, reasons=NO_STATE,
        within=WITHIN_STALE, counts=("dropped_seal",),
        inject=states(rewritten(Seal(b"another key here"), tampering.as_it_is)),
    ),
    Fault(
        name="of another version", group=MESSAGES, effect=STOPS, reasons=NO_STATE,
        within=WITHIN_STALE, counts=("dropped_version",),
        inject=edited(tampering.other_version),
    ),
    Fault(
        name="of another session", group=MESSAGES, effect=STOPS, reasons=NO_STATE,
        within=WITHIN_STALE, counts=("dropped_session",),
        inject=edited(tampering.other_session),
    ),
    Fault(
        name="made for another scene", group=MESSAGES, effect=STOPS, reasons=NO_STATE,
        within=WITHIN_STALE, counts=("dropped_scene",),
        inject=edited(tampering.other_scene),
    ),
    Fault(
        name="a position is NaN", group=CONTENT, effect=STOPS, within=("cycle",),
        reasons=("NOT_FINITE",), inject=edited(tampering.put_first(float("nan"))),
    ),
    Fault(
        name="a position is infinite", group=CONTENT, effect=STOPS, within=("cycle",),
        reasons=("NOT_FINITE",), inject=edited(tampering.put_first(float("inf"))),
    ),
    Fault(
        name="a position is 1e308", group=CONTENT, effect=STOPS, within=("cycle",),
        reasons=("STATE_JUMPED", "OUT_OF_LIMITS"),
        inject=edited(tampering.put_first(1e308)),
    ),
    Fault(
        name="a position jumps by 0.2", group=CONTENT, effect=STOPS, within=("cycle",),
        reasons=("STATE_JUMPED",), inject=edited(tampering.shift_first(0.2)),
    ),
    Fault(
        name="the whole state freezes", group=CONTENT, effect=STOPS,
        reasons=NO_STATE, within=WITHIN_STALE,
        inject=fresh(lambda ground: rewritten(ground.seal, tampering.frozen())),
    ),
    Fault(
        name="positions freeze", group=CONTENT, effect=STOPS, within=("hangs", "cycle"),
        reasons=("STATE_FROZEN",),
        inject=fresh(
            lambda ground: rewritten(ground.seal, tampering.positions_frozen())
        ),
    ),
    *(
        Fault(
            name=name, group=CONTENT, effect=STOPS, within=("hangs", "cycle"),
            reasons=CONTRADICTS, inject=edited(tampering.velocities_changed(change)),
        )
        for name, change in (
            ("velocities are 0", tampering.nothing),
            ("velocities have the other sign", tampering.negative),
            ("velocities are a tenth as large", tampering.tenth),
            ("velocities of joints are swapped", tampering.turned_round),
        )
    ),
    Fault(
        name="stamps go back", group=CONTENT, effect=STOPS, within=("cycle",),
        reasons=("TIME_BACKWARDS",), inject=edited(tampering.shift_stamp(-0.5)),
    ),
    Fault(
        name="stamps from the future", group=CONTENT, effect=STOPS, within=("cycle",),
        reasons=("STAMP_AHEAD",), inject=edited(tampering.shift_stamp(0.5)),
    ),
    Fault(
        name="a stamp is NaN", group=CONTENT, effect=STOPS, within=("cycle",),
        reasons=("STAMP_MISSING",), inject=edited(tampering.shift_stamp(float("nan"))),
    ),
    Fault(
        name="robots that do not exist", group=CONTENT, effect=STOPS, reasons=NO_STATE,
        within=WITHIN_STALE, counts=("dropped_robots",),
        inject=edited(tampering.other_robots),
    ),
    Fault(
        name="a joint too few", group=CONTENT, effect=STOPS, reasons=NO_STATE,
        within=WITHIN_STALE, counts=("dropped_joints",),
        inject=fresh(lambda ground: tampering.joint_missing(ground.seal)),
    ),
    Fault(
        name="a second controller", group=CONTENT, effect=GOES_ON,
        counts=("dropped_second_controller",), inject=injections.second_controller,
    ),
    Fault(
        name="desired motion is lost", group=COMMANDER, effect=RESTS,
        reasons=("WISH_OLD",), within=("desired", "cycle"),
        inject=tampered(lambda _: on(DESIRED, tampering.lost)),
    ),
    Fault(
        name="desired motion is NaN", group=COMMANDER, effect=RESTS,
        reasons=("NO_WISH", "WISH_OLD"), within=("desired", "cycle"),
        counts=("dropped_wish_not_finite",),
        inject=tampered(
            lambda g: on(DESIRED, rewritten(g.seal, tampering.nan_desired))
        ),
    ),
    Fault(
        name="desired motion is 300 ms late", group=COMMANDER, effect=RESTS,
        reasons=("WISH_OLD", "NO_WISH"), within=("desired", "cycle"), hold=0.6,
        counts=("dropped_wish_late",),
        inject=tampered(lambda _: on(COMMANDS, tampering.late(0.3))),
    ),
    Fault(
        name="desired motion is 2 s late", group=COMMANDER, effect=RESTS,
        reasons=("WISH_OLD", "NO_WISH"), within=("desired", "cycle"), hold=2.3,
        counts=("dropped_wish_late",),
        inject=tampered(lambda _: on(COMMANDS, tampering.late(2.0))),
    ),
    Fault(
        name="a second commander", group=COMMANDER, effect=GOES_ON,
        counts=("claims_refused", "dropped_not_commander"),
        inject=injections.second_commander,
    ),
    Fault(
        name="the commander is killed", group=COMMANDER, effect=RESTS, hold=0.8,
        reasons=("WISH_OLD", "NO_COMMANDER"), within=("desired", "cycle"),
        counts=("commander_lost",), inject=injections.killed("operator"),
    ),
    Fault(
        name="the commander is paused", group=COMMANDER, effect=RESTS,
        reasons=("WISH_OLD", "NO_COMMANDER"), within=("desired", "cycle"),
        inject=injections.paused("operator"),
    ),
    Fault(
        name="an observer orders a stop", group=COMMANDER, hold=1.0, effect=STOPS,
        reasons=("STOP_ORDERED",), within=("cycle",), counts=("stop_orders",),
        inject=injections.stop_ordered,
    ),
    Fault(
        name="an observer commands", group=STRANGERS, effect=GOES_ON,
        counts=("dropped_role",), inject=injections.observer_commands,
    ),
    Fault(
        name="a client without a key", group=STRANGERS, effect=GOES_ON,
        counts=("dropped_seal",), inject=injections.without_key,
    ),
    Fault(
        name="a hello is replayed", group=STRANGERS, effect=GOES_ON,
        counts=("dropped_challenge",), inject=injections.hello_replayed,
    ),
    Fault(
        name="fixtures are removed with every key", group=STRANGERS, effect=GOES_ON,
        counts=("calls_refused",), inject=injections.fixtures_removed,
    ),
    Fault(
        name="a sensor places an object", group=STRANGERS, effect=GOES_ON,
        inject=injections.object_placed,
    ),
    Fault(
        name="an object is seen where it cannot be", group=STRANGERS, effect=STOPS,
        reasons=("OBJECT_JUMPED",), within=("cycle",),
        inject=injections.wrongly_seen(
            lambda first: {"pose": Pose(xyz=injections.FARTHER), "stamp": first + 1e-3},
            "OBJECT_JUMPED",
        ),
    ),
    Fault(
        name="an object is seen in two places at once", group=STRANGERS,
        effect=STOPS, reasons=("OBJECT_REPEATED",), within=("cycle",),
        inject=injections.wrongly_seen(
            lambda _: {"pose": Pose(xyz=injections.FARTHER)}, "OBJECT_REPEATED"
        ),
    ),
    Fault(
        name="sightings go back", group=STRANGERS, effect=STOPS,
        reasons=("OBJECT_BACKWARDS",), within=("cycle",),
        inject=injections.wrongly_seen(
            lambda first: {"stamp": first - 0.1}, "OBJECT_BACKWARDS"
        ),
    ),
    Fault(
        name="an object is seen to be too fast", group=STRANGERS, effect=STOPS,
        reasons=("OBJECT_TOO_FAST",), within=("cycle",),
        inject=injections.wrongly_seen(
            lambda first: {"stamp": first + 1e-3, "velocity": [100.0, 0.0, 0.0]},
            "OBJECT_TOO_FAST",
        ),
    ),
    Fault(
        name="a sighting is NaN", group=STRANGERS, effect=STOPS,
        reasons=("OBJECT_NOT_FINITE",), within=("cycle",),
        inject=injections.wrongly_seen(
            lambda first: {"stamp": first + 1e-3, "velocity": [float("nan")] * 3},
            "OBJECT_NOT_FINITE",
        ),
    ),
    Fault(
        name="a sighting is from the future", group=STRANGERS, effect=GOES_ON,
        counts=("calls_refused",),
        inject=injections.wrongly_seen(
            lambda first: {"stamp": first + 10.0}, "OBJECT_AHEAD"
        ),
    ),
    Fault(
        name="a flood of calls", group=STRANGERS, effect=GOES_ON,
        counts=("dropped_busy",), inject=injections.calls_flood,
    ),
    Fault(
        name="200 clients come and go", group=STRANGERS, effect=GOES_ON,
        counts=("hellos",), inject=injections.clients_come_and_go,
    ),
    Fault(
        name="all answers are lost", group=ANSWERS, effect=STOPS_ITSELF,
        within=("client",),
        inject=tampered(lambda _: on((Kind.COMMAND,), tampering.lost, up=False)),
    ),
    Fault(
        name="all answers are corrupted", group=ANSWERS, effect=STOPS_ITSELF,
        within=("client",),
        inject=tampered(
            lambda _: on((Kind.COMMAND,), tampering.corrupted(), up=False)
        ),
    ),
    Fault(
        name="answers arrive twice", group=ANSWERS, effect=GOES_ON,
        inject=tampered(lambda _: on((Kind.COMMAND,), tampering.doubled, up=False)),
    ),
    Fault(
        name="ten readers that never read", group=ANSWERS, effect=GOES_ON, hold=1.0,
        inject=injections.slow_readers,
    ),
    Fault(
        name="noise on the port", group=ANSWERS, effect=GOES_ON,
        counts=("dropped_too_short", "dropped_magic"), inject=injections.flooded,
    ),
    Fault(
        name="a page of another site", group=DOORS, effect=GOES_ON,
        inject=doors.page_of_another_site,
    ),
    Fault(
        name="a command is forged over Zenoh", group=DOORS, effect=GOES_ON,
        inject=doors.command_over_zenoh,
    ),
    Fault(
        name="scenes that are made to hurt", group=DOORS, effect=GOES_ON,
        inject=doors.hostile_scenes,
    ),
    Fault(
        name="the controller is killed", group=PROCESSES, effect=REPORTED_ONLY,
        reasons=NO_STATE, within=WITHIN_STALE, inject=injections.killed("arms"),
    ),
    Fault(
        name="the controller is paused", group=PROCESSES, effect=REPORTED_ONLY,
        reasons=NO_STATE, within=WITHIN_STALE, inject=injections.paused("arms"),
    ),
    Fault(
        name="the service is killed", group=PROCESSES, effect=STOPS_ITSELF,
        within=("client",), inject=injections.killed("service"),
    ),
    Fault(
        name="the service is killed and back at once", group=PROCESSES,
        effect=STOPS_ITSELF, within=("client",), hold=1.0,
        inject=injections.killed_and_back,
    ),
    Fault(
        name="the service is paused", group=PROCESSES, effect=STOPS_ITSELF,
        reasons=HELD_UP, within=("client",), hold=0.5,
        inject=injections.paused("service"),
    ),
    Fault(
        name="the service is ended", group=PROCESSES, effect=STOPS,
        reasons=("SHUTDOWN",), within=("cycle",), inject=injections.ended,
    ),
    Fault(
        name="its port is taken", group=PROCESSES, effect=GOES_ON,
        inject=injections.port_taken,
    ),
    Fault(
        name="the wall clock is set back", group=PROCESSES, effect=GOES_ON,
        inject=injections.wall_clock_set_back,
    ),
    Fault(
        name="the recorder is killed, and started again", group=PROCESSES,
        effect=GOES_ON, hold=2.0, counts=("companions_restarted",),
        inject=injections.companion_killed(
            "recorder", "armguard.recording", ("--record", "{folder}/record")
        ),
    ),
    Fault(
        name="the view is killed", group=PROCESSES, effect=GOES_ON, hold=0.6,
        counts=("companions_ended",),
        inject=injections.companion_killed("view", "armguard.view", ("--view",)),
    ),
    *REFLEX_FAULTS,
    *SENSOR_FAULTS,
)  # fmt: skip
