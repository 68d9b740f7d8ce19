"""Recordings that lie: numbers, texts and files changed, all checksums right.

Each mutant is tried in a forked worker, so a signal, an error that is none of ours, a
mutant that takes too long and the memory it took are all seen.
"""

import json
import os
import resource
import signal
import struct
import tempfile
import time
import traceback
import zlib
from collections import Counter
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from armguard.errors import ArmguardError
from armguard.geometry import Box, Hull, Pose, Sphere
from armguard.recording import calls, open_recording
from armguard.recording.blocks import HEAD, pack_block, unpack_block
from armguard.recording.frames import HEADER, IN_FRAME, Kind, words
from armguard.recording.mcap_file import McapFile
from armguard.recording.recorded import RecordedGuard
from armguard.recording.recorder import Recorder, RecorderSettings
from armguard.recording.recording import ABOUT, SCENE
from armguard.recording.replay import replay
from armguard.recording.ring import RingReader, RingWriter
from armguard.recording.ros import FRAMES
from armguard.report import findings_of, write_page
from armguard.respond import Guard
from armguard.scene import Grasp, Gripper, Scene
from armguard.scene.settings import ResponseSettings
from gripping.gantry import FIGURES, gantry

PERIOD = 0.001

# Boxes that are placed; of so many a leaf of the index is divided where all are.
CRATES = tuple(f"crate{k}" for k in range(8))

# A mutant that takes longer ends its worker [s].
PATIENCE = 20

# Mutants a worker tries before another one is forked.
SHARE = 2000

# One of so many mutants is a whole file.
FILES = 50

# What comes before the text of a checkpoint: what it is, layout, length.
BEFORE_TEXT = 8 + 16

# Magnitudes nothing has, and the bits that are worst as a place.
WORST = (
    *(struct.pack("<q", n) for n in (1 << 40, -1, -(1 << 63), (1 << 31) - 1, 1 << 32)),
    *(struct.pack("<d", x) for x in (np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324)),
    *(struct.pack("<d", x) for x in (-1.0, 1e18, float(1 << 40))),
    *(struct.pack("<ii", a, b) for a, b in ((-1, 0), (0, -1), (1 << 30, 1 << 30))),
)


def scene_to_attack():
    """A gantry that grips, evades and is led, among objects that come and go."""
    scene = Scene(mode="path")
    scene.period = PERIOD
    scene.add_robot(
        gantry(),
        name="arm",
        stopping=FIGURES,
        home={"x": 0.0, "y": 0.0, "z": 0.2, "open_left": 0.04, "open_right": 0.04},
        gripper=Gripper(link="hand", fingers=("left", "right")),
        response=ResponseSettings(kind="field", evade=True),
    )
    table = Box(size=(2.0, 2.0, 0.1))
    scene.add(table, name="table", pose=Pose(xyz=(0, 0, -0.05)))
    for name, x in (("block", 0.0), ("other", 0.3)):
        scene.add(
            Box(size=(0.04, 0.04, 0.06)),
            name=name,
            pose=Pose(xyz=(x, 0.0, 0.03)),
            graspable=Grasp(),
        )
    corners = 0.03 * np.array([*np.ndindex(2, 2, 2)], dtype=np.float64)
    scene.add(Hull(points=corners), name="stone", pose=Pose(xyz=(0.5, 0.5, 0.1)))
    for name in CRATES:
        scene.add(Box(size=(0.2, 0.2, 0.2)), name=name, present=False)
    scene.add(Sphere(radius=0.05), name="ball", present=False, top_speed=1.0)
    return scene


class Tape:
    """A guard that is recorded while it grips a block and carries it."""

    def __init__(self, ring):
        self.scene = scene_to_attack()
        self.guard = Guard(self.scene, self_test=False)
        self.tape = RecordedGuard(self.guard, ring, monotonic=lambda: self.t,
                                  wall=lambda: 1.7e9 + self.t)  # fmt: skip
        self.q, self.t = self.guard.home, 0.0
        self.v = np.zeros_like(self.q)
        self.checkpoints = []

    def keep(self):
        """A checkpoint, for the ring and to be attacked."""
        self.checkpoints.append(self.guard.checkpoint())
        self.tape.checkpoint()

    def cycle(self, desired):
        """One cycle."""
        self.t += PERIOD
        command = self.tape.filter(self.q, desired, self.t, velocity=self.v, now=self.t)
        self.v = command.velocity
        self.q = self.q + self.v * PERIOD

    def go(self, speed, **goal):
        """Lead joints to positions."""
        names = [name.split("/")[1] for name in self.guard.q_names]
        own = [names.index(name) for name in goal]
        for _ in range(3000):
            desired = np.zeros_like(self.q)
            desired[own] = 8.0 * (np.array([*goal.values()]) - self.q[own])
            if np.abs(desired).max() < 1e-3 and np.abs(self.v).max() < 1e-3:
                break
            desired *= min(1.0, speed / np.linalg.norm(desired))
            self.cycle(desired)

    def drive(self):
        """All that a recording can hold."""
        self.tape.describe(self.scene, {"scene_file": "gantry", "version": "0"})
        self.keep()
        self.go(0.1, z=0.16)
        self.keep()
        for k, name in enumerate(CRATES):
            pose = Pose(xyz=(0.5 + 0.1 * k, -0.5, 0.2))
            self.tape.do(calls.Place(name=name, pose=pose))
        pose = Pose(xyz=(0.4, 0.5, 0.2), rpy=(0.1, 0.2, 0.3))
        self.tape.do(calls.Place(name="stone", pose=pose))
        pose = Pose(xyz=(-0.6, 0.0, 0.3))
        self.tape.do(calls.Place(name="ball", pose=pose, stamp=self.t,
                                 velocity=(0.5, 0.0, 0.0)))  # fmt: skip
        self.tape.do(calls.Place(name="other", pose=Pose(xyz=(0.3, 0.1, 0.03))))
        for _ in range(30):
            self.cycle(np.zeros_like(self.q))
        self.keep()
        self.tape.do(calls.Remove(name="ball"))
        self.tape.do(calls.Engage())
        self.go(0.08, z=0.1)
        self.go(0.02, open_left=0.02, open_right=0.02)
        self.tape.do(calls.Grasp(robot="arm", name="block"))
        self.keep()
        self.go(0.1, z=0.14)
        self.tape.do(calls.Allow(a="block", b="other", until=self.t + 1.0))
        self.tape.do(calls.FieldGoal(name="arm", q=self.guard.home))
        for _ in range(40):
            self.cycle(np.zeros_like(self.q))
        self.keep()
        self.tape.do(calls.Retreat(name="arm"))
        for _ in range(20):
            self.cycle(np.zeros_like(self.q))
        self.keep()
        self.tape.do(calls.SwapModel(robot="arm", model="coarse"))
        self.cycle(np.zeros_like(self.q))
        self.keep()


def word(rng):
    """Eight bytes to put in the place of others."""
    k = rng.integers(5)
    if k == 0:
        return rng.bytes(8)
    if k == 1:
        return struct.pack("<q", int(rng.integers(-3, 12)))
    if k == 2:
        return struct.pack("<d", float(rng.integers(-3, 12)))
    return WORST[rng.integers(len(WORST))]


def junk(rng, depth=0):
    """A value JSON has, of any type."""
    k = int(rng.integers(9 if depth < 3 else 7))
    if k < 7:
        return (None, True, -1, 1e308, "arm", float("nan"), 1 << 70)[k]
    items = [junk(rng, depth + 1) for _ in range(rng.integers(3))]
    return items if k == 7 else {str(n): item for n, item in enumerate(items)}


def changed_text(text, rng):
    """Bytes of JSON with something in it that is something else."""
    k = rng.integers(6)
    if k == 0:
        return b"[" * 200_000
    if k == 1:
        return rng.bytes(len(text))
    try:
        value = json.loads(text)
    except ValueError:
        return text
    places = [(value, key) for key in value] if isinstance(value, dict) else []
    for holder, key in places[:]:
        if isinstance(holder[key], dict):
            places += [(holder[key], other) for other in holder[key]]
    if not places or k == 2:
        return json.dumps(junk(rng)).encode()
    holder, key = places[rng.integers(len(places))]
    if k == 3:
        del holder[key]
    else:
        holder[key] = junk(rng)
    return json.dumps(value).encode()


def changed_checkpoint(data, guard, rng):
    """A checkpoint with some of its words, or its text, changed."""
    (size,) = struct.unpack_from("<Q", data, BEFORE_TEXT)
    start = BEFORE_TEXT + 8 + size
    if rng.random() < 0.1:
        text = changed_text(data[start - size : start].rstrip(), rng)
        text += b" " * (-len(text) % 8)
        head = data[:BEFORE_TEXT] + struct.pack("<Q", len(text))
        return head + text + data[start:]
    mutant = bytearray(data)
    if rng.random() < 0.01:
        # All that was placed is as large as can be, and in one place.
        where = guard._objects.places_of(sorted(guard._objects.changed))
        rows = len(data) - 7 * 8 - len(where) - 16 * 8 * len(where)
        for k in range(guard.tables.moving_count, len(where)):
            half = struct.pack("<d", 10.0 ** rng.uniform(0.0, 9.0))
            mutant[rows + (16 * k + 4) * 8 : rows + (16 * k + 7) * 8] = 3 * half
        return bytes(mutant)
    words = (len(data) - start) // 8
    count = (1, 2, 5, 30, words // 5)[rng.integers(5)]
    sizes = [array.nbytes for array in guard._saving.arrays.values()]
    ends = np.cumsum([start, *sizes])
    for _ in range(count):
        # Small arrays hold what decides: each is as likely as a large one.
        k = rng.integers(len(sizes) + 1)
        end = ends[k + 1] if k < len(sizes) else len(data)
        if end - ends[k] < 8:
            continue
        at = int(ends[k] + rng.integers((end - ends[k]) // 4) * 4)
        mutant[at : at + 8] = word(rng)
    return bytes(mutant[: len(data)]).ljust(len(data), b"\0")


class Checkpoints:
    """Checkpoints that lie, each restored and gone on from."""

    def __init__(self, tape):
        self.guard, self.good = tape.guard, tape.checkpoints
        self.q, self.t = tape.q, tape.t

    def warm(self, rng):
        """Compile what mutants will call."""
        for _ in range(40):
            self.go_on(self.good[rng.integers(len(self.good))], rng)

    def try_one(self, rng):
        """Change one and go on from it."""
        good = self.good[rng.integers(len(self.good))]
        self.go_on(changed_checkpoint(good, self.guard, rng), rng)

    def go_on(self, data, rng):
        """Restore a checkpoint and go on."""
        guard = self.guard
        guard.restore(data)
        for k in range(3):
            t = self.t + (k + 1) * PERIOD
            guard.filter(self.q, 0.1 * rng.normal(size=len(self.q)), t,
                         velocity=0.0 * self.q, now=t)  # fmt: skip
        call, *words = (
            ("grasp", "arm", "other"),
            ("release", "arm", "block"),
            ("retreat", "arm"),
            ("place", CRATES[0], Pose(xyz=(0.4, 0.1, 0.5))),
            ("remove", "stone"),
            ("swap_model", "arm", "auto"),
            ("engage",),
            ("reset",),
        )[rng.integers(8)]
        try:
            getattr(guard, call)(*words)
        except ArmguardError:
            pass
        guard.filter(self.q, 0.0 * self.q, t + PERIOD, velocity=0.0 * self.q)
        guard.checkpoint()
        str(guard.contracts)


class Files:
    """Recordings that lie, each replayed and reported on."""

    def __init__(self, paths, folder):
        found = [open_recording(path) for path in paths]
        self.recordings = [[*one.messages()] for one in found]
        self.about, self.scene = found[0]._attached(ABOUT), found[0]._attached(SCENE)
        self.path, self.page = folder / "mutant.mcap", folder / "mutant.html"

    def warm(self, rng):
        """Compile what mutants will call."""
        for messages in self.recordings:
            self.read(self.about, self.scene, messages)

    def try_one(self, rng):
        """Change one and read it."""
        about, scene = self.about, self.scene
        recorded = messages = self.recordings[rng.integers(len(self.recordings))]
        kind = rng.integers(8)
        if kind == 0:
            about = changed_text(about, rng)
        elif kind == 1:
            scene = self.changed_scene(rng)
        else:
            messages = [*messages]
            for _ in range(int(rng.integers(1, 6))):
                k = rng.integers(len(messages))
                if recorded[k].topic == FRAMES.number:
                    # A block that was changed may be readable no more.
                    data = changed_block(recorded[k].data, rng)
                    messages[k] = messages[k]._replace(data=data)
        self.read(about, scene, messages)

    def read(self, about, scene, messages):
        """Write a recording, replay it and report on it.

        Raises:
            ArmguardError: It cannot be read.
        """
        with self.path.open("wb") as out:
            file = McapFile(out.write, "attack", {})
            file.attach(ABOUT, "application/json", about, 0)
            file.attach(SCENE, "", scene, 0)
            for message in messages:
                file.add(message)
            file.end()
        problem = None
        for read in (lambda: replay(open_recording(self.path)), self.report):
            try:
                read()
            except ArmguardError as error:
                problem = error
        if problem is not None:
            raise problem

    def report(self):
        """A page about it."""
        write_page(findings_of(open_recording(self.path), prove_seconds=0), self.page)

    def changed_scene(self, rng):
        """A scene that is none, or one that fills the memory."""
        k = rng.integers(4)
        if k == 0:
            return zlib.compress(b" " * (1 << 28))
        if k == 1:
            return rng.bytes(2000)
        return zlib.compress(changed_text(zlib.decompress(self.scene), rng))


def changed_block(data, rng):
    """A block of frames in which one frame says something else."""
    if rng.random() < 0.1:
        count, width = HEAD.unpack_from(data)
        count, width = (int(x) for x in rng.integers(0, 1 << 32, 2))
        return HEAD.pack(count, width) + data[HEAD.size :]
    rows = [row.copy() for row in unpack_block(data)]
    row = rows[rng.integers(len(rows))]
    end = len(row)
    if rng.random() < 0.6:
        end = HEADER
    for _ in range(int(rng.integers(1, 4))):
        at = int(rng.integers(end))
        row[at] = struct.unpack("<d", word(rng))[0]
    if (
        rng.random() < 0.3
        and row[IN_FRAME.kind] != Kind.CYCLE
        and 0 < row[IN_FRAME.text] < 8 * end
    ):
        # A text that is something else, of the same length.
        size = int(row[IN_FRAME.text])
        room = row[HEADER : HEADER + words(size)].view(np.uint8)
        text = changed_text(room.tobytes()[:size], rng)[: len(room)]
        room[: len(text)] = np.frombuffer(text, np.uint8)
        room[len(text) :] = ord(" ")
    if rng.random() < 0.1:
        row[IN_FRAME.data] = np.inf
    return pack_block(rows)


def work(target, seeds, done, answer):
    """Try mutants one after another; `done` says how many, in the end the answer."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    counted = Counter()
    longest, first_trace = 0.0, ""
    before = most_memory()
    for k, seed in enumerate(seeds):
        done.value = k
        rng = np.random.default_rng(seed)
        signal.alarm(PATIENCE)
        start = time.monotonic()
        try:
            target.try_one(rng)
            counted["accepted"] += 1
        except ArmguardError:
            counted["refused"] += 1
        except BaseException:
            counted["tracebacks"] += 1
            first_trace = first_trace or f"{seed}: {traceback.format_exc()}"
        signal.alarm(0)
        longest = max(longest, time.monotonic() - start)
    grown = most_memory() - before
    times = {"longest_s": longest, "grown_mb": grown, "trace": first_trace}
    answer.send({**counted, **times})


def most_memory():
    """Most memory that this process has held; a fork begins with its parent's [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def try_all(target, seeds, figures):
    """Try mutants in forked workers; what came of it is added to figures."""
    context = get_context("fork")
    while len(seeds):
        share = seeds[:SHARE]
        count = context.RawValue("q")
        answer, end = context.Pipe(duplex=False)
        child = context.Process(target=work, args=(target, share, count, end))
        child.start()
        end.close()
        try:
            found = answer.recv()
        except EOFError:
            found = None
        child.join()
        done = len(share) if found else count.value + 1
        if found is None:
            figures["signals"] += 1
            figures["by_signal"][str(-child.exitcode)] += 1
            figures["seeds"].append(int(share[done - 1]))
        else:
            for name in ("accepted", "refused", "tracebacks"):
                figures[name] += found.get(name, 0)
            for name in ("longest_s", "grown_mb"):
                figures[name] = max(figures[name], found[name])
            if found["trace"]:
                figures["traces"].append(found["trace"])
        figures["tried"] += done
        seeds = seeds[done:]


def run(count: int, seed: int) -> dict:
    """Try mutants of checkpoints and of files.

    Args:
        count: How many.
        seed: Which ones.
    """
    answer = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ring = RingWriter(folder / "ring")
        tape = Tape(ring)
        tape.drive()
        recorder = Recorder(folder, RecorderSettings(file_time=1.0))
        for row in RingReader(folder / "ring").unread():
            recorder.take(row)
        recorder.end()
        ring.close()
        recordings = sorted(folder.glob("recording-*.mcap"))
        files = count // FILES
        for kind, target, tries in (
            ("checkpoints", Checkpoints(tape), count - files),
            ("files", Files(recordings, folder), files),
        ):
            answer[kind] = figures = {
                **dict.fromkeys(("tried", "signals", "tracebacks"), 0),
                **{"refused": 0, "accepted": 0, "longest_s": 0.0, "grown_mb": 0.0},
                **{"by_signal": Counter(), "seeds": [], "traces": []},
            }
            target.warm(np.random.default_rng(seed))
            first = seed << 32
            try_all(target, np.arange(first, first + tries), figures)
    return answer
