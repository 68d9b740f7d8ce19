"""Inputs of a page end with its heartbeat, whatever its sockets do."""

import asyncio
import json
import subprocess
import sys
import time
from pathlib import Path

import msgspec
import numpy as np
import pytest
from tests.view.conftest import channel_of, greet, running, until
from websockets.asyncio.client import connect

from armguard.recording.rights import Role
from armguard.recording.ring import beat, end_pulse
from armguard.respond.command import Action
from armguard.service.client import Client
from armguard.service.wire.keys import keys_path, read_keys, write_keys
from armguard.view.driver import LEFT, Heartbeats
from armguard.view.jog import HELD
from armguard.view.live_view import LiveView

PATIENCE = 30.0

# A page says that it lives this often here [s].
PULSE = 0.05


def moves(view):
    """Whether the arm is commanded to move."""
    frame = view.source.newest
    return frame is not None and bool(np.any(frame.told[: len(frame.q)]))


def leads_tool(view):
    """Whether the handle of the left arm leads it."""
    return view.driver.leads_tool("left")


def desires(view):
    """Whether the view desires motion."""
    return bool(view.driver.desired(view.source.newest).velocities.any())


def ready(view):
    """Have the arm stand, in the clear, with the command."""
    assert until(lambda: view.source.newest is not None and not moves(view))
    assert until(lambda: view.commander.claim() or view.commander.claim(force=True))
    assert until(lambda: view.commander.call("engage"))
    assert until(lambda: not view.world.cycle(view.source.newest).command.held)


def drag(view):
    """A message that drags the left arm's handle up."""
    handle = view.drive.handles.nodes["left"]
    x, y, z = (float(v) for v in handle.position)
    return msgspec.msgpack.encode(
        {
            "type": "TransformControlsUpdateMessage",
            "name": "/handles/left",
            "wxyz": [float(v) for v in handle.wxyz],
            "position": [x, y, z + 0.3],
        }
    )


async def pulse(channel, seconds, held, done=lambda: False):
    """Say that a page lives, for some time or until something is so; whether it is."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and not done():
        await channel.send(json.dumps({"type": "pulse", "held": held}))
        await asyncio.sleep(PULSE)
    return done()


@pytest.mark.parametrize("held", [None, False], ids=["silent", "released"])
def test_one_message_of_a_drag_moves_no_longer_than_a_key(live, held):
    view, browser = live
    ready(view)
    view.drive.handles.show(True)
    assert until(lambda: "left" in view.drive.handles.nodes)

    async def act():
        channel, scene = await greet(view, browser)
        async with channel as channel, scene as scene:
            if held is None:
                # Both sockets stay open, and the page says nothing.
                await scene.send(drag(view))
                await asyncio.sleep(2.0)
            else:
                await scene.send(drag(view))
                await pulse(channel, 2.0, held)
            return moves(view), leads_tool(view)

    assert asyncio.run(act()) == (False, False)
    view.drive.handles.show(False)


def test_a_drag_leads_while_its_pointer_is_down_and_ends_when_the_page_freezes(live):
    view, browser = live
    ready(view)
    view.drive.handles.show(True)
    assert until(lambda: "left" in view.drive.handles.nodes)

    async def act():
        channel, scene = await greet(view, browser)
        async with channel as channel, scene as scene:
            await scene.send(drag(view))
            led = await pulse(channel, PATIENCE, True, lambda: leads_tool(view))
            await asyncio.sleep(2.0)
            return led, leads_tool(view), moves(view)

    assert asyncio.run(act()) == (True, False, False)
    view.drive.handles.show(False)


def test_the_tele_driver_rests_without_a_pulse_and_ends_with_the_last_page(live):
    view, browser = live

    class Hands:
        def drive(self, t, q, blocked):
            return np.full_like(q, 0.05), []

    async def act():
        channel, _ = await greet(view, browser)
        async with channel as channel:
            await pulse(channel, 0.3, held=False)
            view.driver.tele = Hands()
            drove = await pulse(channel, PATIENCE, False, lambda: desires(view))
            await asyncio.sleep(2 * HELD)
            frozen = desires(view)
            there = view.driver.tele is not None
            await pulse(channel, 0.3, held=False)
        return drove, frozen, there

    ready(view)
    assert asyncio.run(act()) == (True, False, True)
    assert until(lambda: view.driver.tele is None, 1.0)


def test_silence_ends_inputs():
    now = 0.0
    beats = Heartbeats(lambda: now)
    beats.beat("a", held=True)
    beats.beat("b", held=False)
    assert beats.holds("a") and not beats.holds("b")
    now = HELD + 0.01
    assert not beats.holds("a")
    assert beats.silence("a") == beats.silence() == now
    beats.beat("b", held=True)
    # Another page's hand holds nothing of this one.
    assert not beats.holds("a")
    beats.end("b")
    assert beats.silence("b") > LEFT
    beats.end("a")
    assert beats.silence() > LEFT


async def first_state(view, browser, what):
    """The first state sent to a page of which something is true."""
    channel = connect(channel_of(view.login.link), additional_headers=browser)
    async with channel as page, asyncio.timeout(PATIENCE):
        while True:
            message = json.loads(await page.recv())
            if message["type"] == "state" and what(message):
                return message


def test_a_stop_by_a_person_is_named_and_engaged_from_the_page(live):
    view, browser = live
    ready(view)
    asyncio.run(first_state(view, browser, lambda message: not message["held"]))
    with Client(view.commander._client.port, role=Role.OBSERVE, name="person") as one:
        one.connect()
        one.stop()
    message = asyncio.run(first_state(view, browser, lambda message: message["held"]))
    assert message["name"] == message["word"] == "HELD"
    assert message["why"].startswith("STOPPED BY A PERSON, since ")
    assert "press Engage all" in message["why"]
    assert [robot["word"] for robot in message["robots"]] == ["held"]
    # The tele-driver leaves it to a person.
    view.driver.tele = Engaging()

    async def press():
        channel, _ = await greet(view, browser)
        async with channel as page:
            await pulse(page, 0.5, held=False)
            held = view.world.cycle(view.source.newest).command.held
            await page.send(json.dumps({"type": "engage"}))
            return held

    assert asyncio.run(press())
    view.driver.tele = None
    message = asyncio.run(
        first_state(view, browser, lambda message: not message["held"])
    )
    assert "STOPPED" not in message["why"]


class Engaging:
    """Hands that engage whatever waits."""

    def drive(self, t, q, blocked):
        return np.zeros_like(q), ["left"]


def test_an_engagement_from_the_page_leaves_the_command_where_it_was(live, stage):
    view, _ = live
    view.commander.give_back()
    with Client(stage.port, name="other") as other:
        other.connect()
        other.claim()
        other.stop()
        assert until(lambda: other.latest.action is Action.HOLD)
        view.commander.engage()
        assert until(lambda: other.latest.action is not Action.HOLD)
        other.claim()


@pytest.mark.parametrize("role", [Role.OBSERVE, Role.SENSE, Role.COMMAND])
def test_a_page_may_what_its_key_may_and_always_stop(stage, tmp_path, role):
    keys = {
        each: key
        for each, key in read_keys(keys_path(stage.port)).items()
        if each <= role
    }
    file = tmp_path / "keys"
    write_keys(file, keys)
    with running(LiveView(stage.port, 0, keys=file)) as view:
        assert (view.drive is not None) == (role >= Role.COMMAND)
        assert (view.edit is not None) == (role >= Role.SENSE)
        assert view.editor.movable == ()
        if role < Role.COMMAND:
            assert not view.commander.claim()
        assert until(lambda: "may" in view.page.newest)
        may = json.loads(view.page.newest["may"])
        assert (may["role"], may["engage"]) == (role.word, role >= Role.COMMAND)
        assert until(lambda: view.source.newest is not None)
        before = view.source.newest.cycle
        view._received("one", {"type": "stop"})

        def held():
            frame = view.source.newest
            return frame.cycle > before and view.world.cycle(frame).command.held

        assert until(held)


def test_a_recorder_that_falls_silent_is_shown(live):
    view, browser = live
    ring = Path(view._welcome.ring)

    async def said(what):
        channel = connect(channel_of(view.login.link), additional_headers=browser)
        async with channel as page, asyncio.timeout(PATIENCE):
            while True:
                message = json.loads(await page.recv())
                if message["type"] == "recorder" and bool(message["said"]) == what:
                    return message["said"]

    beat(ring)
    assert asyncio.run(said(True)).startswith("NOT RECORDING since ")
    end_pulse(ring)
    assert asyncio.run(said(False)) == ""


def test_a_companion_takes_the_service_s_key_file(stage, tmp_path):
    file = tmp_path / "keys"
    write_keys(file, read_keys(keys_path(stage.port)))
    module = (sys.executable, "-m", "armguard.view", "--page-port", "0")
    at = ("--service", str(stage.port))
    with subprocess.Popen(
        [*module, *at, "--key-file", str(file)], stdout=subprocess.PIPE, text=True
    ) as process:
        line = process.stdout.readline()
        process.terminate()
    assert "?token=" in line
    refused = subprocess.run(
        [*module, *at, "--key-file", str(tmp_path / "none")],
        capture_output=True,
        check=False,
        text=True,
        timeout=PATIENCE,
    )
    assert refused.returncode == 2
    assert "KeyFileError" in refused.stderr and "Traceback" not in refused.stderr
