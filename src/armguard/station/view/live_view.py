"""The view of a running service: its ring is drawn, its client drives."""

import queue
import secrets
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import viser

from armguard.scene.bay import bay_path
from armguard.station.client import Client, Welcome
from armguard.station.errors import NoServiceError, StationError
from armguard.station.frames import Frame, Kind
from armguard.station.ring import recorder_age
from armguard.station.simulated import TeleDriver
from armguard.station.simulated.operator import Operator
from armguard.station.view.drive_tab import DriveTab
from armguard.station.view.driving.commander import Commander
from armguard.station.view.driving.driver import Driver
from armguard.station.view.edit_tab import EditTab
from armguard.station.view.editing.editor import Editor
from armguard.station.view.live import LiveFrames
from armguard.station.view.service_scene import guarded_scene
from armguard.station.view.view import View, at_rate
from armguard.station.wire.keys import Role, found_keys

# A frame that is older than this is not the present any more [s].
OLD = 0.5

# Time between two attempts to find a service that went away, and how long each may
# take [s].
AGAIN, ATTEMPT = 1.0, 0.2

# A recorder that said nothing for so long records no more, and how often that is looked
# at [s].
NOT_RECORDING, LOOKS = 3.0, 0.5

# Answers are only looked at for who commands: one in so many cycles will do.
EVERY = 5


class LiveView:
    """Shows a service and drives through it, also after it was started anew.

    Attributes:
        view: The page.
        driver: Who drives.
        commander: What driving goes through.

    Args:
        port: Port of the service.
        page_port: Where the page is to be; 0 for any port that is free.
        keys: File with the service's keys; the one that clients find by themselves if
            None. The page may do what its highest role may.

    Raises:
        NoServiceError: No service answers.
        KeyFileError: The file cannot be used.
        StationError: The page's port is taken, or the scene is not the service's.
        RingError: The service's ring is not on this machine.
    """

    def __init__(
        self, port: int, page_port: int = 8080, *, keys: Path | None = None
    ) -> None:
        role = highest_role(port, keys)
        client = Client(port, role=role, keys=keys, name="view", every=EVERY)
        self._jobs: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._tried = time.monotonic()
        self._welcome = client.connect()
        self.commander = Commander(client, role, self._complain)
        self._may: dict[str, Any] = {}
        self._recording, self._looked = "", -float("inf")
        self.view = View(guarded_scene(self._welcome), page_port, self._heard)
        self._add_tabs()
        self._watch()

        @self.view.server.on_client_disconnect
        def _(_: viser.ClientHandle) -> None:
            # The hand that held a handle or a slider is gone.
            self.driver.let_go()

    def run(self, until: Callable[[], bool]) -> None:
        """Draw until told not to."""
        at_rate(self.draw, until)

    def draw(self) -> None:
        """Draw the newest cycle, or say why there is none."""
        while not self._jobs.empty():
            self._jobs.get()()
        self._tell_what_it_may()
        self._tell_of_recorder()
        self.view.remark = self.commander.remark
        self.view.changed = self.commander.changed
        frame = self._frames.newest
        if self.view.draw(frame) and frame is not None:
            if self._drive is not None:
                self._drive.show(frame, time.monotonic())
            if self._edit is not None:
                self._edit.show(frame)
        age = self._frames.age()
        if age >= OLD:
            self.view.tell(frame, self._why_old(age))
            self._find_again()

    def close(self) -> None:
        """Give the command back, let go of ring, page and service."""
        self._close_tabs()
        self._frames.close()
        self.view.close()
        self.commander.close()

    def _add_tabs(self) -> None:
        """Put up the tabs by which the scene that is shown is driven and edited."""
        view, world = self.view, self.view.world
        file = Path(self._welcome.scene_file) if self._welcome.scene_file else None
        self.driver = Driver(
            world.tables,
            lambda: self._frames.newest,
            self.commander,
            self.commander.stop,
        )
        self._editor = Editor(
            world.tables,
            world.placements,
            self.commander.call,
            changeable={
                name
                for name, thing in world.scene.objects.items()
                if thing.movable or self.commander.role >= Role.ADMINISTER
            },
        )
        self._drive: DriveTab | None = None
        self._edit: EditTab | None = None
        if self.commander.role >= Role.COMMAND:
            with view.tabs.add_tab("Drive", viser.Icon.DEVICE_GAMEPAD_2):
                self._drive = DriveTab(
                    view.server,
                    world,
                    self.driver,
                    self.commander,
                    lambda: Operator(TeleDriver(world.tables, secrets.randbits(31))),
                    lambda on: view.page.tell("driving", {"on": on}, keep=True),
                )
        if self.commander.role >= Role.SENSE:
            with view.tabs.add_tab("Edit", viser.Icon.CUBE):
                # The bundled scene belongs to everybody.
                own = file if file != bay_path() else None
                self._edit = EditTab(view.server, world, self._editor, own)
        view.page.tell("driving", {"on": False}, keep=True)

    def _close_tabs(self) -> None:
        self.driver.close()
        self._editor.close()

    def _watch(self) -> None:
        """Read the service's ring from now on."""
        self._hash = self._welcome.scene_hash
        ring = Path(self._welcome.ring)
        self._frames = LiveFrames(ring, self.view.cue, self._other)
        # What was placed before the oldest record that the ring still has.
        self.view.world.placements.begin_with(self.commander.objects())
        self._frames.start()
        self.driver.start()

    def _other(self, frame: Frame) -> None:
        """What is no cycle, from the ring's thread."""
        text = frame.text
        if frame.kind is Kind.EVENT:
            self.view.world.placements.take(text)
        elif text.get("note") == "scene" and text["scene_hash"] != self._hash:
            self._hash = text["scene_hash"]
            self._jobs.put(self._adopt_settings)

    def _adopt_settings(self) -> None:
        """The service goes on with other settings of its scene."""
        try:
            self._greet(self.commander.connect(timeout=1.0))
        except StationError as error:
            self._complain(str(error))

    def _find_again(self) -> None:
        """Look for a service at the same port that was started anew."""
        now = time.monotonic()
        if self.commander.alive or now - self._tried < AGAIN:
            return
        try:
            self._greet(self.commander.connect(ATTEMPT))
        except StationError:
            pass
        self._tried = time.monotonic()

    def _greet(self, welcome: Welcome) -> None:
        """Show what a service guards that was said hello to anew, if that is new."""
        known = self._welcome.session, self._welcome.scene_hash
        if known == (welcome.session, welcome.scene_hash):
            # It was only silent for a while.
            return
        scene = guarded_scene(welcome)
        self._close_tabs()
        self._frames.close()
        self._welcome = welcome
        self.view.show_scene(scene)
        self._add_tabs()
        self._watch()

    def _why_old(self, age: float) -> str:
        """Why there is nothing new."""
        if self._frames.closed:
            return "the service has ended"
        why = "" if self.commander.alive else f": {self.commander.cause.sentence}"
        return f"nothing new since {age:.1f} s{why}"

    def _heard(self, page: str, said: Mapping[str, Any]) -> None:
        """What a page says, from the page's thread."""
        kind = said["type"]
        if kind == "stop":
            self.commander.stop()
        elif kind == "gone":
            self.driver.gone(page)
        elif kind == "engage":
            if self.commander.role >= Role.COMMAND:
                # The page's thread has to hear the next stop meanwhile.
                self._jobs.put(self.commander.engage)
        elif kind == "pulse":
            self.driver.pulses.hear(page, said.get("held") is True)
        elif kind in ("keys", "pad"):
            self.driver.jog.hear(said)

    def _tell_what_it_may(self) -> None:
        """Tell pages what they may do, when that is something else than before."""
        commander = self.commander
        may = {
            "role": commander.role.word,
            "engage": commander.role >= Role.COMMAND,
            "taken": commander.taken,
        }
        if may != self._may:
            self._may = may
            self.view.page.tell("may", may, keep=True)

    def _tell_of_recorder(self) -> None:
        """Tell pages since when nothing is recorded that is to be."""
        now = time.monotonic()
        if now - self._looked < LOOKS:
            return
        self._looked = now
        age = recorder_age(Path(self._welcome.ring)) or 0.0
        when = time.strftime("%H:%M:%S", time.localtime(time.time() - age))
        said = f"NOT RECORDING since {when}" if age > NOT_RECORDING else ""
        # The time it began, not each new reading of it.
        if bool(said) != bool(self._recording):
            self._recording = said
            self.view.page.tell("recorder", {"said": said}, keep=True)

    def _complain(self, sentence: str) -> None:
        """Tell everybody why something was not done."""
        for client in self.view.server.get_clients().values():
            client.add_notification("Refused", sentence, color="orange")


def highest_role(port: int, keys: Path | None) -> Role:
    """The highest role that a key is there for.

    Args:
        port: Port of the service.
        keys: Its key file; the one that clients find by themselves if None.

    Raises:
        KeyFileError: The file cannot be used.
    """
    try:
        found, _ = found_keys(keys, port)
    except NoServiceError:
        # The client waits for it, and says what is missing.
        return Role.OBSERVE
    return max(found)
