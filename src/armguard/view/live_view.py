"""The view of a running service: its ring is drawn, its client drives and edits."""

import queue
import secrets
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import viser

from armguard.errors import NoServiceError, StationError
from armguard.recording.frames import IN_FRAME, Frame, Kind, frame_of
from armguard.recording.rights import Role
from armguard.recording.ring import RingReader, recorder_age
from armguard.scene import Scene, compile_scene
from armguard.scene.settings import CHOICES
from armguard.service.client import Client, Welcome
from armguard.service.link import ask
from armguard.service.server.scenes import BUNDLED, open_scene, scene_hash
from armguard.service.wire.keys import found_keys
from armguard.simulation import TeleDriver
from armguard.simulation.operator import Operator
from armguard.simulation.rig_link import ask_rig
from armguard.view.commander import Commander
from armguard.view.drive_tab import MODES, DriveTab
from armguard.view.driver import Driver
from armguard.view.edit_tab import Editor, EditTab
from armguard.view.lateness import BUSY, Lateness
from armguard.view.line_items import LineItems
from armguard.view.sensed import SensorTab
from armguard.view.view import View

# Time between two looks into the ring; a level is shown within it [s].
LOOK = 0.004

# A frame that is older than this is not the present any more [s].
OLD = 0.5

# Time between two attempts to find a service that went away, and how long each may
# take [s].
AGAIN, ATTEMPT = 1.0, 0.2

# A recorder that reports nothing for so long records no more, and how often that is
# looked at [s].
NOT_RECORDING, LOOKS = 3.0, 0.5

# A refusal is shown for so long [s].
SHOWN = 10.0

# The client needs answers only while it commands: one in so many cycles will do.
EVERY = 5


class LiveFrames:
    """Reads every frame of a ring; the newest cycle is drawn, never a queue.

    Every record is looked at, so that no level is missed however short it was.

    Attributes:
        newest: The newest cycle, None before there is one.

    Args:
        path: The ring's file.
        cycle: Called with every cycle that is written from `start` on, in order.
        other: Called with every other frame, and those before it.

    Raises:
        RingError: There is no ring.
    """

    newest: Frame | None = None

    def __init__(
        self, path: Path, cycle: Callable[[Frame], None], other: Callable[[Frame], None]
    ) -> None:
        self._reader = RingReader(path)
        self._cycle, self._other = cycle, other
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ring", daemon=True)

    @property
    def closed(self) -> bool:
        """Whether the loop has ended its ring."""
        return self._reader.closed

    @property
    def age(self) -> float:
        """Time since the newest cycle was written [s]; infinite before the first."""
        newest = self.newest
        return float("inf") if newest is None else time.monotonic() - newest.monotonic

    def start(self) -> None:
        """Take the events that are in the ring already, then read in a thread."""
        self._read(lambda frame: None)
        self._thread.start()

    def close(self) -> None:
        """Close the ring."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)
        self._reader.close()

    def _run(self) -> None:
        while not self._stop.wait(LOOK):
            self._read(self._cycle)

    def _read(self, cycle: Callable[[Frame], None]) -> None:
        """Take in what has been written since the last look."""
        for row in self._reader.unread():
            if int(row[IN_FRAME.kind]) == Kind.CYCLE:
                self.newest = frame_of(row)
                cycle(self.newest)
            else:
                self._other(frame_of(row))


class LiveView(View):
    """Shows a service and drives through it, also after it was started anew.

    Attributes:
        driver: Makes one desired motion of all inputs.
        commander: The client that driving and editing go through.
        editor: Changes objects.
        source: The ring's frames.
        drive: The tab to drive by; None if the role may not.
        edit: The tab to edit by; None if the role may not.

    Args:
        port: Port of the service.
        page_port: Port of the page; 0 for any port that is free.
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
        try:
            role = max(found_keys(keys, port)[0])
        except NoServiceError:
            # The client waits for it, and names the missing key.
            role = Role.OBSERVE
        client = Client(port, role=role, keys=keys, name="view", every=EVERY)
        # What the page's and the ring's threads leave to the one that draws.
        self._jobs: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._tried = time.monotonic()
        self._recording, self._looked = "", -float("inf")
        self._refused, self._port = -float("inf"), port
        self._lateness = Lateness()
        self._welcome = client.connect()
        self.commander = Commander(client, role, self._complain)
        super().__init__(guarded_scene(self._welcome), page_port, self._received)
        self._begin()

        @self.server.on_client_disconnect
        def _(_: viser.ClientHandle) -> None:
            self.driver.release()

    def step(self) -> None:
        """Draw the newest cycle, or say why there is none."""
        while not self._jobs.empty():
            self._jobs.get()()
        commander = self.commander
        may = {"role": commander.role.word, "engage": commander.role >= Role.COMMAND}
        may |= {"taken": commander.taken, "commands": commander.commands}
        self.page.publish("may", may)
        self._publish_recorder()
        self.page.publish("busy", {"said": BUSY if self._lateness.busy else ""})
        if time.monotonic() - self._refused > SHOWN:
            self.page.publish("refused", {"said": "", "remedy": ""})
        self.remark, self.changed = commander.remark, commander.changed
        self.draw(self.source.newest)
        age = self.source.age
        if age < OLD:
            return
        why = "" if commander.alive else f": {commander.cause.sentence}"
        why = f"nothing new since {age:.1f} s{why}"
        closed = self.source.closed
        self.publish(self.source.newest, "the service has ended" if closed else why)
        if not commander.alive and time.monotonic() - self._tried >= AGAIN:
            try:
                self._greet(ATTEMPT)
            except StationError:
                pass
            self._tried = time.monotonic()

    def close(self) -> None:
        """Give the command back; close ring, page and connection."""
        self._end()
        super().close()
        self.commander.close()

    def _begin(self) -> None:
        """Add the tabs to drive and edit by, and read the service's ring."""
        commander, world, welcome = self.commander, self.world, self._welcome
        self.driver = Driver(world, lambda: self.source.newest, commander)
        administers = commander.role >= Role.ADMINISTER
        changeable = {
            name
            for name, item in world.scene.objects.items()
            if item.movable or administers
        }
        self.editor = Editor(world, commander.call, changeable)
        self.drive: DriveTab | None = None
        self.edit: EditTab | None = None
        if commander.role >= Role.COMMAND:
            with self.tabs.add_tab("Drive", viser.Icon.DEVICE_GAMEPAD_2):
                self.drive = DriveTab(
                    world,
                    self.driver,
                    commander,
                    lambda: Operator(TeleDriver(world.tables, secrets.randbits(31))),
                    lambda on: self.page.publish("driving", {"on": on}),
                )
            self.drawables += self.drive, self.drive.handles
        if commander.role >= Role.SENSE:
            file = welcome.scene_file
            with self.tabs.add_tab("Edit", viser.Icon.CUBE):
                # Bundled scenes are shared by all users.
                own = Path(file) if file and not bundled_name(file) else None
                self.edit = EditTab(world, self.editor, own)
            self.drawables.append(self.edit)
        if world.scene.sensors:
            with self.tabs.add_tab("Sensors", viser.Icon.RADAR):
                port = self._port
                tab = SensorTab(world, lambda faults: ask_rig(port, faults))
            self.drawables.append(tab)
        self.drawables.append(
            LineItems(
                world,
                lambda: ask(self._port, "line"),
                lambda state: self.page.publish("line", state),
            )
        )
        self.page.publish("driving", {"on": False})
        self._hash = welcome.scene_hash
        self.source = LiveFrames(Path(welcome.ring), self._judged, self._other)
        # Objects that were placed before the oldest record in the ring.
        world.objects.begin_with(commander.objects())
        self.source.start()
        self.driver.start()

    def _end(self) -> None:
        """End the inputs of the scene that is shown, and close its ring."""
        self.driver.close()
        self.editor.close()
        self.source.close()

    def _judged(self, frame: Frame) -> None:
        """Take a cycle, from the ring's thread."""
        self._lateness.add(frame)
        self.publish(frame)

    def _other(self, frame: Frame) -> None:
        """Take a frame that is no cycle, from the ring's thread."""
        text = frame.text
        if frame.kind is Kind.EVENT:
            self.world.objects.apply(text)
            self.world.sensed.apply(text)
        elif text.get("note") == "sensors":
            self.world.sensed.note(text)
        elif text.get("note") == "scene" and text["scene_hash"] != self._hash:
            self._hash = text["scene_hash"]
            self._jobs.put(self._adopt_settings)

    def _adopt_settings(self) -> None:
        """Show the scene with the settings that the service has changed."""
        try:
            self._greet(1.0)
        except StationError as error:
            self._complain(str(error))

    def _greet(self, timeout: float) -> None:
        """Connect to the service anew, and show its scene if that is new.

        Args:
            timeout: How long to wait for an answer [s].

        Raises:
            StationError: No service answers, or its scene is not the one in the file.
        """
        welcome, known = self.commander.connect(timeout), self._welcome
        if (known.session, known.scene_hash) == (welcome.session, welcome.scene_hash):
            # It was only silent for a while.
            return
        scene = guarded_scene(welcome)
        self._end()
        self._welcome = welcome
        self.show_scene(scene)
        self._begin()

    def _received(self, page: str, message: Mapping[str, Any]) -> None:
        """Take a page's message, in the page's thread."""
        kind = message["type"]
        if kind == "stop":
            self.commander.stop()
        elif kind == "gone":
            self.driver.page_closed(page)
        elif kind == "engage":
            if self.commander.role >= Role.COMMAND:
                # This thread has to receive the next stop meanwhile.
                self._jobs.put(self.commander.engage)
        elif kind == "drive":
            if self.drive is not None:
                self._jobs.put(self.drive.begin)
        elif kind == "pulse":
            self.driver.heartbeats.beat(page, message.get("held") is True)
        elif kind in ("keys", "pad"):
            self.driver.jog.receive(message)

    def _publish_recorder(self) -> None:
        """Send pages since when a recorder that has begun records nothing."""
        now = time.monotonic()
        if now - self._looked < LOOKS:
            return
        self._looked = now
        age = recorder_age(Path(self._welcome.ring)) or 0.0
        if age <= NOT_RECORDING:
            self._recording = ""
        elif not self._recording:
            # The time it ended, not each new reading of it.
            when = time.strftime("%H:%M:%S", time.localtime(time.time() - age))
            self._recording = f"NOT RECORDING since {when}"
        self.page.publish("recorder", {"said": self._recording})

    def _complain(self, sentence: str) -> None:
        """Show all pages why something was not done, and the button that helps."""
        commander, self._refused = self.commander, time.monotonic()
        may = commander.role >= Role.COMMAND and not commander.commands
        remedy = "Take the command" if may else ""
        self.page.publish("refused", {"said": sentence, "remedy": remedy})


def guarded_scene(welcome: Welcome) -> Scene:
    """The scene of a service; its tables have the service's hash.

    Args:
        welcome: The service's description of itself.

    Raises:
        StationError: The scene that is found is another one, so drawing it would show
            something that was not checked.
        SceneError: There is no such scene.
    """
    name = bundled_name(welcome.scene_file) or welcome.scene_file or "two-pandas"
    late, stale = float(welcome.text["late"]), welcome.text["stale"]
    scene, _ = open_scene(name, period=welcome.period, late=late, stale=stale)
    for settings in settings_of(scene):
        for robot, (mode, response) in settings.items():
            scene.set_mode(mode, robot)
            scene.set_response(response, robot)
        if scene_hash(compile_scene(scene)) == welcome.scene_hash:
            return scene
    raise StationError(
        f"the service guards another scene than the one in '{name}'; was the file "
        "changed since it started? start it again"
    )


def bundled_name(file: str) -> str:
    """Name of the bundled scene in a file; empty if it has none."""
    return next((name for name, path in BUNDLED.items() if str(path()) == file), "")


def settings_of(scene: Scene) -> Iterator[dict[str, tuple[Any, Any]]]:
    """Mode and response of each robot that a service may have.

    As `serve` and `configure` set them: those of the scene, or one for all.
    """
    own = {name: (robot.mode, robot.response) for name, robot in scene.robots.items()}
    for mode in (None, *MODES):
        for kind in (None, *CHOICES["kind"]):
            yield {
                name: (mode or own_mode, kind or response)
                for name, (own_mode, response) in own.items()
            }
