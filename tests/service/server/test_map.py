"""The map as a process beside a service: real sockets, signals and recordings."""

import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import armguard as ag
from armguard.cells.view import CellView
from armguard.errors import RefusedError
from armguard.guard.levels import Reason
from armguard.recording.calls import UpdateCells, UpdateClusters
from armguard.recording.frames import Kind, frame_of
from armguard.recording.ring import RingReader
from armguard.scene.sensing import SENSED as SENSED_BODY
from service_arms import PATIENCE

SENSED = """
sensing:
  {{region: {{centre: [-0.4, 0, 1.1], size: 128}}, cell: 0.025, unknown: {unknown}
  intruder: {{speed: 1.6, size: 0.05}}, stale: {stale}}}
sensors:
  top: {{kind: depth, size: [64, 48], focal: 60, range: [0.2, 2.5],
         at: {{xyz: [-0.2, 0, 2.3], rpy: [3.14159265, 0, 0]}}}}
"""

# Age of the cells that stops robots [s]: a busy machine must not be taken for it.
STALE = 2.0


@pytest.fixture(scope="module")
def sensed_bay(patient_bay, tmp_path_factory):
    """Writes the file of a bay with a camera, whose robots have further settings."""

    def write(settings=""):
        text = patient_bay.read_text(encoding="utf-8")
        text = text.replace(
            "bay_arm.urdf\n", f"bay_arm.urdf\n    mode: path\n{settings}"
        )
        text += SENSED.format(unknown="free, reason: a test,", stale=STALE)
        file = tmp_path_factory.mktemp("sensed") / "bay.yaml"
        file.write_text(text, encoding="utf-8")
        return file

    return write


@pytest.fixture(scope="module")
def sensed_bay_file(sensed_bay):
    return sensed_bay()


# Pixels of a box beside the last link of the left arm, at home.
BESIDE = np.s_[9:15, 28:35]


def sees(answer):
    """Whether the nearest pair is of something sensed."""
    near = answer.nearest
    return near is not None and SENSED_BODY in (near.a, near.b)


class Station:
    """A service with a map, arms at rest and a camera that looks at a bare floor."""

    def __init__(self, served, scene):
        self.served, self.scene = served, scene
        self.client, self.camera = served.client(), ag.SensorClient(served.port)
        self.camera.connect(PATIENCE)
        self.rng, self.process = np.random.default_rng(1), None
        self.box, self.depth = None, 1100
        self._looked = 0.0

    def start_map(self, *options):
        command = [
            sys.executable, "-m", "armguard", "sense", str(self.scene), "--service",
            f"127.0.0.1:{self.served.port}", *options,
        ]  # fmt: skip
        self.process = subprocess.Popen(command, stderr=subprocess.DEVNULL)

    def turn(self):
        """A cycle, and a frame when it is due."""
        q = self.client.welcome.home
        answer = self.client.cycle(q, 0 * q, 0 * q, self.client.clock(), timeout=1.0)
        now = time.monotonic()
        if now - self._looked > 0.04:
            self._looked = now
            if self.camera is None:
                return answer
            image = 2250 + self.rng.integers(-4, 5, (48, 64))
            if self.box is not None:
                image[self.box] = self.depth
            self.camera.depth("top", image.astype(np.uint16), self.camera.clock())
        time.sleep(0.002)
        return answer

    def until(self, done, patience=60.0):
        end = time.monotonic() + patience
        while not done(answer := self.turn()):
            assert time.monotonic() < end, (
                answer.sentence,
                self.camera and self.camera.health,
            )
        return answer

    def known(self):
        """Turn until the cells are known."""
        return self.until(lambda a: a.reason is not Reason.CELLS_STALE)

    def close(self):
        self.client.close()
        self.camera.close()
        if self.process is not None and self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.terminate()
            self.process.wait(30)


@pytest.fixture(scope="module")
def station(serving, sensed_bay_file):
    @contextmanager
    def start(*options):
        with serving(*options, scene=str(sensed_bay_file)) as served:
            one = Station(served, sensed_bay_file)
            try:
                yield one
            finally:
                one.close()

    return start


@pytest.fixture(scope="module")
def running(station):
    """A station whose map a companion of the service fills."""
    with station("--sense") as one:
        one.known()
        yield one


def test_what_a_camera_sees_is_in_the_verdict_and_goes_with_it(running):
    running.until(lambda a: not sees(a))
    running.box = BESIDE
    try:
        running.until(sees)
    finally:
        running.box = None
    running.until(lambda a: not sees(a))
    running.until(lambda a: running.camera.health == {"top": "in order"})


def test_a_sensor_that_falls_silent_is_named(running):
    camera, running.camera = running.camera, None
    try:
        running.until(lambda a: "SILENT" in camera.health["top"])
    finally:
        running.camera = camera
    running.until(lambda a: camera.health["top"] == "in order")


def test_frames_that_cannot_be_are_refused_by_the_client(running):
    camera = running.camera
    with pytest.raises(RefusedError, match=r"no sensor is named 'tip'.*'top'"):
        camera.depth("tip", np.zeros((48, 64)), 0.0)
    with pytest.raises(RefusedError, match="real numbers"):
        camera.depth("top", [["a"]], 0.0)
    with pytest.raises(RefusedError, match="from 0 to 255"):
        camera.zones("top", np.zeros((8, 8)), np.full((8, 8), 256), 0.0)


def test_noise_and_a_flood_on_its_port_change_nothing(running):
    port, rng = running.camera.frames_port, np.random.default_rng(5)
    before = running.camera.health
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        for k in range(20_000):
            one.sendto(rng.bytes(int(rng.integers(0, 300))), ("127.0.0.1", port))
            if k % 200 == 0:
                assert running.turn().reason is not Reason.CELLS_STALE
    running.until(lambda a: running.camera.health == before == {"top": "in order"})


def test_a_second_map_is_refused(running):
    counters = running.served.counters
    before, maps = counters.value("dropped_second_map"), counters.value("maps")
    running.start_map()
    try:
        running.until(lambda a: counters.value("dropped_second_map") > before)
        assert counters.value("maps") == maps
        assert running.turn().reason is not Reason.CELLS_STALE
    finally:
        running.process.terminate()
        running.process.wait(30)


def test_a_companion_that_is_killed_is_started_again_and_the_map_begins_anew(running):
    counters = running.served.counters
    maps = counters.value("maps")
    children = subprocess.run(
        ["ps", "-o", "pid=,args=", "--ppid", str(running.served.process.pid)],
        check=True, capture_output=True, text=True,
    ).stdout  # fmt: skip
    pid = next(r.split()[0] for r in children.splitlines() if "service.mapping" in r)
    subprocess.run(["kill", "-KILL", pid], check=True)
    running.until(lambda a: a.reason is Reason.CELLS_STALE)
    running.until(lambda a: counters.value("maps") > maps)
    running.known()
    assert counters.value("companions_restarted") >= 1


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_map_that_is_killed_or_stopped_stops_the_arms(station, number):
    with station() as one:
        assert one.turn().reason is Reason.CELLS_STALE
        one.start_map()
        one.known()
        one.process.send_signal(number)
        began = time.monotonic()
        one.until(lambda a: a.reason is Reason.CELLS_STALE)
        # What it knew was as new as its last frame.
        assert time.monotonic() - began <= STALE + 0.5
        if number == signal.SIGKILL:
            one.process.wait()
            one.start_map()
        else:
            one.process.send_signal(signal.SIGCONT)
        one.known()


def test_a_map_finds_a_service_that_was_started_anew(serving, sensed_bay_file):
    with serving(scene=str(sensed_bay_file)) as first:
        one = Station(first, sensed_bay_file)
        one.start_map()
        one.known()
        one.client.close()
        one.camera.close()
    port = f"--port={first.port}"
    with serving(port, scene=str(sensed_bay_file)) as second:
        two = Station(second, sensed_bay_file)
        two.process = one.process
        two.known()
        two.close()


def test_the_map_refuses_a_service_of_another_scene(served, sensed_bay_file):
    asked = [
        sys.executable, "-m", "armguard", "sense", "SCENE", "--service",
        f"127.0.0.1:{served.port}",
    ]  # fmt: skip
    for scene, says in (("two-pandas", "no sensors"), (str(sensed_bay_file), "other")):
        asked[4] = scene
        done = subprocess.run(
            asked, check=False, capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 2 and says in done.stderr


def test_a_body_that_a_camera_sees_move_is_given_to_the_guard(serving, sensed_bay):
    scene = sensed_bay("    response: {evade: true}\n")
    with serving("--sense", scene=str(scene)) as served:
        one = Station(served, scene)
        reader = RingReader(Path(one.client.welcome.ring), newest=True)
        one.known()
        # It rises towards the camera, on its axis, again and again.
        speed, began, found = 0.4, time.monotonic(), []

        def seen(_):
            way = speed * (time.monotonic() - began) % 1.5
            one.box = np.s_[21:27, 29:35] if way < 1.0 else None
            one.depth = 1800 - int(1e3 * way)
            found.extend(clusters_of(reader))
            return found and len(found[-1])

        one.until(seen)
        [body] = found[-1]
        assert np.linalg.norm(body.velocity - (0.0, 0.0, speed)) <= body.error
        assert body.velocity[2] > 0.5 * speed
        # When it is gone, the guard gets none once.
        one.box = None

        def ended(_):
            found.extend(clusters_of(reader))
            return not len(found[-1])

        one.until(ended)
        one.close()


def clusters_of(reader):
    """Clusters in the calls that were recorded since the last call."""
    frames = [frame_of(row) for row in reader.unread()]
    words = [one.text for one in frames if one.kind is Kind.EVENT]
    return [
        UpdateClusters.model_validate({"clusters": one["clusters"]}).clusters
        for one in words
        if one["call"] == "update_clusters"
    ]


def test_recorded_frames_give_the_map_that_the_guard_had(station, tmp_path):
    file = tmp_path / "frames.bin"
    with station() as one:
        one.start_map("--record", str(file))
        reader = RingReader(Path(one.client.welcome.ring), newest=True)
        one.known()
        one.box = BESIDE
        for _ in range(100):
            one.turn()
        # Without frames and states all changes are taken at some time.
        time.sleep(3.0)
        one.process.terminate()
        one.process.wait(30)
        view = CellView((-0.4, 0, 1.1), 0.025, 128)
        for row in reader.unread():
            frame = frame_of(row)
            if frame.kind is Kind.EVENT and frame.text["call"] == "update_cells":
                words = {k: v for k, v in frame.text.items() if k != "call"}
                view.apply(UpdateCells.model_validate(words).deltas)
        assert reader.lost == 0
    sense = ag.Sense(ag.load_scene(one.scene))
    assert sense.play(file) > 100
    assert (sense.cells.occupied() == view.occupied()).all()
    assert (sense.cells.known_free() == view.known_free()).all()
    assert view.occupied().any() and view.known_free().any()
