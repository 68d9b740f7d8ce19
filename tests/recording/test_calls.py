"""Calls as data: each has its right, its method, its event and its rows in the docs."""

import inspect
import json
import re
from base64 import b64encode
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest

from armguard import Box, Guard, Pose, Reason, Region, Sphere, bay_scene
from armguard.cells.deltas import Delta
from armguard.errors import ArmguardError, RefusedError
from armguard.guard.clusters import Cluster
from armguard.guard.objects import SightingError
from armguard.record import dtype_of
from armguard.recording.calls import CALLS, Call, GuardCall, call_of
from armguard.recording.frames import Kind, frame_of, text_frame, text_of
from armguard.recording.recorded import RecordedGuard
from armguard.recording.replay import do
from armguard.recording.ring import RingReader, RingWriter
from armguard.service.client.exchange import request_of
from armguard.service.server.rpc import Calls, permitted, read_call
from armguard.service.wire import Cause, Role

DOCS = Path(__file__).parents[2] / "docs"

POSE = Pose(xyz=(0.1, 0.2, 0.3))
T = "[[1.0, 0.0, 0.0, 0.1], [0.0, 1.0, 0.0, 0.2], [-0.0, 0.0, 1.0, 0.3], "
T += "[0.0, 0.0, 0.0, 1.0]]"
REGION = Region(size=(0.2, 0.2, 0.4), pose=POSE, frame="arm/hand")
BOX = Box(size=(0.2, 0.4, 0.6))

# Changes of two words of a map.
CHANGES = b64encode(bytes(range(2 * dtype_of(Delta).itemsize))).decode()
CLUSTERS = b64encode(bytes(range(2 * dtype_of(Cluster).itemsize))).decode()


# Calls with what programs give them, and their text in recordings since version 0.1.
EVENTS = (
    ("engage", {}, '"name": null, "ordered": true'),
    (
        "engage",
        {"name": "left", "ordered": False},
        '"name": "left", "ordered": false',
    ),
    (
        "grasp",
        {"robot": "arm", "name": "block"},
        '"robot": "arm", "name": "block"',
    ),
    (
        "release",
        {"robot": "arm", "name": "block"},
        '"robot": "arm", "name": "block"',
    ),
    (
        "allow",
        {"a": "arm/left", "b": "table"},
        '"a": "arm/left", "b": "table", "region": null, "depth": 0.002, '
        '"speed": 0.02, "until": null',
    ),
    (
        "allow",
        {"a": "peg", "b": "plate", "region": REGION, "depth": 0.003, "until": 12.5},
        '"a": "peg", "b": "plate", "region": {"size": [0.2, 0.2, 0.4], '
        '"xyz": [0.1, 0.2, 0.3], "rpy": [0.0, 0.0, 0.0], "frame": "arm/hand"}, '
        '"depth": 0.003, "speed": 0.02, "until": 12.5',
    ),
    (
        "swap_model",
        {"robot": "arm", "model": "coarse"},
        '"robot": "arm", "model": "coarse"',
    ),
    ("retreat", {}, '"name": null, "to": "path"'),
    (
        "retreat",
        {"name": "arm", "to": np.array([0.1, 0.2])},
        '"name": "arm", "to": [0.1, 0.2]',
    ),
    (
        "field_goal",
        {"name": "arm", "q": [0.1, 0.2]},
        '"name": "arm", "q": [0.1, 0.2], "pose": null',
    ),
    (
        "field_goal",
        {"name": "arm", "pose": POSE},
        f'"name": "arm", "q": null, "pose": {T}',
    ),
    ("reset", {}, ""),
    (
        "place",
        {"name": "cart", "pose": POSE},
        f'"name": "cart", "pose": {T}, "stamp": null, "velocity": null, "shape": null',
    ),
    (
        "place",
        {
            "name": "cart",
            "pose": POSE.matrix(),
            "stamp": 1.25,
            "velocity": (0.5, 0.0, 0.0),
            "shape": BOX,
        },
        f'"name": "cart", "pose": {T}, "stamp": 1.25, "velocity": [0.5, 0.0, 0.0], '
        '"shape": {"kind": "box", "size": [0.2, 0.4, 0.6], "rounding": 0.0}',
    ),
    ("remove", {"name": "cart"}, '"name": "cart"'),
    (
        "update_cells",
        {"deltas": CHANGES, "stamp": 2.5},
        f'"deltas": "{CHANGES}", "stamp": 2.5',
    ),
    ("update_clusters", {"clusters": CLUSTERS}, f'"clusters": "{CLUSTERS}"'),
)

# What of the guard is no call: cycles, looks, and what only other guards are used for.
NO_CALLS = {
    *("step", "filter", "filter_positions", "filter_twists", "stop", "solve_programs"),
    *("q", "judge_at_rest", "check_path", "checker", "checkpoint", "restore"),
    "announce",
    *("knowledge", "forgetting"),
    *("hold", "take_over", "stand_as", "forget_stops"),
}

FOR = {
    Role.OBSERVE: "role observe",
    Role.SENSE: "role sense",
    Role.COMMAND: "commander",
    Role.ADMINISTER: "commander, role administer",
}
FOR_SESSIONS = {
    Role.OBSERVE: "as in [service.md](service.md)",
    Role.SENSE: "for the role that may",
    Role.COMMAND: "for the session that has the command",
    Role.ADMINISTER: "for the session that has the command",
}


def text_with(call, arguments):
    return f'{{"call": "{call}"{", " * bool(arguments)}{arguments}}}'


class Spy:
    """Takes the place of a guard; keeps what it was called with."""

    def __init__(self):
        self.calls = []

    def __getattr__(self, name):
        return lambda **arguments: self.calls.append((name, arguments))


def classes(base=Call):
    for one in base.__subclasses__():
        yield from classes(one)
        yield one


def rows_of(page, head):
    """Calls in the first column of a table, each with the cells of its row."""
    text = (DOCS / page).read_text(encoding="utf-8")
    table = text.split(head, 1)[1].split("\n\n", 1)[0]
    found = {}
    for line in table.splitlines()[2:]:
        first, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        for name in re.findall(r"`(\w+)", first):
            assert name not in found
            found[name] = cells
    return found


def test_every_class_is_registered_with_its_right():
    assert {one for one in classes() if not one.__subclasses__()} == {*CALLS.values()}
    for name, made in CALLS.items():
        assert (made.call, type(vars(made).get("right"))) == (name, Role)


def test_calls_of_the_guard_are_its_methods_and_take_what_these_take():
    of_guard = {name for name, one in CALLS.items() if issubclass(one, GuardCall)}
    public = inspect.getmembers(Guard, inspect.isfunction)
    methods = {name: one for name, one in public if not name.startswith("_")}
    assert of_guard == methods.keys() - NO_CALLS
    for name in of_guard:
        _, *takes = inspect.signature(methods[name]).parameters.values()
        fields = CALLS[name].model_fields.items()
        given = [
            (key, one.empty if field.is_required() else field.default)
            for one, (key, field) in zip(takes, fields, strict=True)
        ]
        assert given == [(one.name, one.default) for one in takes], name


@pytest.mark.parametrize(("call", "given", "text"), EVENTS)
def test_a_call_is_recorded_as_ever_and_replayed_as_it_was(call, given, text):
    made = CALLS[call](**given)
    event = text_of(made.event).decode()
    assert event == text_with(call, text)
    first, again = Spy(), Spy()
    made.apply(first)
    do(again, frame_of(text_frame(Kind.EVENT, 0, 0.0, 0.0, json.loads(event))))
    ((name, arguments),) = again.calls
    assert name == call
    assert text_of(call_of({"call": name, **arguments}).event).decode() == event
    np.testing.assert_equal(arguments, first.calls[0][1])


def test_every_call_of_the_guard_has_been_recorded_and_replayed_here():
    of_guard = {name for name, one in CALLS.items() if issubclass(one, GuardCall)}
    assert {call for call, _, _ in EVENTS} == of_guard


@pytest.mark.parametrize(("call", "given", "text"), EVENTS)
def test_a_client_says_it_in_words_that_the_service_reads(call, given, text):
    words = {
        "region": {"size": (0.2, 0.2, 0.4), "pose": POSE, "frame": "arm/hand"},
        "shape": {"kind": "box", "size": [0.2, 0.4, 0.6]},
    }
    said = {key: words.get(key, value) for key, value in given.items()}
    request = read_call(request_of(1, call, said))
    made = permitted(request, Role.ADMINISTER, True)
    # The angles of a pose come out of its transform; those of none may be -0.
    event = text_of(made.event).decode()
    assert json.loads(event) == json.loads(text_with(call, text))


@pytest.mark.parametrize("name", CALLS)
def test_no_call_is_made_without_its_right(name):
    right = CALLS[name].right
    request = read_call(request_of(1, name, {"no_such": 1}))
    for role in Role:
        for commands in (False, True):
            may = role >= right and (commands or right < Role.COMMAND)
            why = f"'{name}' takes" if may else "needs the key|claim the command first"
            with pytest.raises(RefusedError, match=why):
                permitted(request, role, commands)


@pytest.mark.parametrize("name", CALLS)
def test_the_service_answers_every_call(name):
    calls = Calls(MagicMock(reflex=Cause.NONE, pulses=None), MagicMock())
    given = next((given for call, given, _ in EVENTS if call == name), {})
    calls._answer(CALLS[name](**given), MagicMock(role=Role.ADMINISTER))


@pytest.mark.parametrize(
    ("call", "arguments", "error", "words"),
    [
        ("grasp", {"robot": "arm"}, RefusedError, "'name' is missing; call 'grasp'"),
        (
            "grasp",
            {"robot": "arm", "name": 3},
            RefusedError,
            "name is 3; it must be a valid str",
        ),
        ("engage", {"ordered": 1}, RefusedError, "ordered is 1; it must be a valid bo"),
        (
            "reset",
            {"now": 1},
            RefusedError,
            "no argument 'now'; call 'reset' takes noth",
        ),
        ("field_goal", {"name": "arm", "q": "far"}, RefusedError, "it must be numbers"),
        (
            "field_goal",
            {"name": "arm", "q": {}},
            RefusedError,
            "q is {}; it must be num",
        ),
        ("place", {"name": "x", "pose": [[1], [2, 3]]}, RefusedError, "be numbers"),
        ("place", {"name": "x", "pose": [10**400]}, RefusedError, "must be numbers"),
        ("objects", {"first": -1}, RefusedError, "first is -1; it must be greater"),
        (
            "allow",
            {"a": "x", "b": "y", "region": 5},
            RefusedError,
            "it must be a region",
        ),
        ("allow", {"a": "x", "b": "y", "region": {}}, RefusedError, "size"),
    ],
)
def test_arguments_that_cannot_be_are_refused_in_words(call, arguments, error, words):
    request = read_call(json.dumps({"id": 1, "call": call, "arguments": arguments}))
    with pytest.raises(error, match=words):
        permitted(request, Role.ADMINISTER, True)


def test_an_error_of_the_package_keeps_its_name():
    where = {"size": [0.0, 2.0, 2.0]}
    for call, arguments, error in (
        ("place", {"name": "x", "pose": None, "shape": {"kind": "bx"}}, "ShapeError"),
        ("allow", {"a": "x", "b": "y", "region": where}, "GraspError"),
        ("allow", {"a": "x", "b": "y", "region": {"pose": [1.0]}}, "PoseError"),
    ):
        request = read_call(json.dumps({"id": 1, "call": call, "arguments": arguments}))
        with pytest.raises(ArmguardError) as refused:
            permitted(request, Role.ADMINISTER, True)
        assert type(refused.value).__name__ == error


def test_only_calls_of_the_guard_are_replayed():
    with pytest.raises(ValueError, match="does nothing to a guard"):
        call_of({"call": "ping"})
    with pytest.raises(KeyError):
        call_of({"call": "step"})


def test_a_call_that_raises_is_recorded_only_if_it_stops_robots(tmp_path):
    def guard_with_ball():
        scene = bay_scene("path")
        scene.add(Sphere(radius=0.05), name="ball", present=False, top_speed=1.0)
        return Guard(scene, self_test=False)

    def stop_of(guard):
        return guard.filter(guard.home, still, 0.02, velocity=still).verdict.reason

    taped = RecordedGuard(guard_with_ball(), RingWriter(tmp_path / "ring"))
    still = np.zeros_like(taped.guard.home)
    for made in (CALLS["engage"](name="nobody"), CALLS["remove"](name="nothing")):
        with pytest.raises(ArmguardError):
            taped.do(made)
    ball, far = CALLS["place"], {"stamp": 0.01, "pose": Pose(xyz=(-3.0, 0.0, 1.0))}
    small = Sphere(radius=0.01)
    taped.do(ball(name="ball", pose=Pose(xyz=(3.0, 0.0, 1.0)), stamp=0.0, shape=small))
    with pytest.raises(SightingError):
        taped.do(ball(name="ball", **far))
    events = [frame_of(row) for row in RingReader(tmp_path / "ring").unread()]
    assert [frame.text["stamp"] for frame in events] == [0.0, 0.01]
    assert [frame.text["shape"]["radius"] for frame in events] == [0.01, 0.01]
    again = guard_with_ball()
    for frame in events:
        do(again, frame)
    assert stop_of(again) is stop_of(taped.guard) is Reason.OBJECT_JUMPED


def test_every_call_has_its_row_in_the_docs():
    rows = rows_of("service.md", "| call | arguments | for |")
    assert rows.keys() == CALLS.keys()
    for name, (arguments, rights) in rows.items():
        made = CALLS[name]
        assert rights.split(";")[0] == FOR[made.right], name
        words = re.findall(r"`(\w+)`", arguments)
        found = [word for word in words if word in made.model_fields]
        assert [*dict.fromkeys(found)] == [*made.model_fields], name
        assert bool(found) is not arguments.startswith("none"), name
    rows = rows_of("zenoh.md", "| call | payload | result |")
    own = {"clock", "welcome", "claim", "give_back"}
    assert rows.keys() - own == CALLS.keys()
    for name in rows.keys() - own:
        assert rows[name][1] == FOR_SESSIONS[CALLS[name].right], name
    assert rows_of("gripping.md", "| call | what it does |").keys() <= CALLS.keys()
