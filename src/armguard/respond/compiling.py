"""First start: two processes compile the kernels and report progress.

If several programs start at once, one compiles and the others wait for it. Otherwise
each would repeat the whole work.
"""

import fcntl
import gc
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from time import monotonic
from typing import Any

import numba
import numpy as np
from numba.core import event

from armguard.geometry import Capsule, Pose, Sphere
from armguard.geometry.pairs import measure
from armguard.geometry.shapes import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard.cycle import run_cycle
from armguard.guard.objects import load_kernels
from armguard.kernel import KERNEL_CACHE, READY_CODE
from armguard.processes import FIRST
from armguard.respond.whole_cycle import (
    begin_filtered_cycle,
    end_filtered_cycle,
    run_filtered_cycle,
)
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from armguard.robot.stopping import stopping_figures
from armguard.scene.scene import Scene
from armguard.scene.settings import Mode
from armguard.separate import kernels_from, link

# Function that makes a guard of a scene and calls the kernels of its cycles.
TryOut = Callable[[Scene], None]

# Greatest time to wait for the other process [s]; without it this one compiles all.
PATIENCE = 600.0

# Files that mark a complete cache, without and with the prediction of stops.
READY = "fixed.ready"
GUARDED_READY = "guarded.ready"

# Approximate number of files of a complete cache, without and with stops.
FILES, GUARDED_FILES = 270, 625

# Time between two sentences on the progress [s].
SAYS = 10.0

# File that the compiling process locks. The lock ends with the process.
LOCK = "compiling.lock"


def is_compiled(guarded: bool) -> bool:
    """Whether a guard's machine code is in the wheel or in the cache."""
    return (
        READY_CODE is not None
        or (KERNEL_CACHE / (GUARDED_READY if guarded else READY)).exists()
    )


@contextmanager
def only_compiler() -> Iterator[None]:
    """Lock this cache, after any other process that compiles into it."""
    KERNEL_CACHE.mkdir(parents=True, exist_ok=True)
    with (KERNEL_CACHE / LOCK).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX)
        except OSError:
            # A file system without locks: two processes may do the same work.
            pass
        yield


@contextmanager
def no_collections() -> Iterator[None]:
    """Collect no garbage while kernels are compiled.

    A compiler keeps most of what it makes: searching that took a tenth of the time. It
    is never searched later either, which would take seconds.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


class TimeLeft(event.Listener):  # type: ignore[misc]
    """Progress report between two kernels, at most one every `SAYS` seconds.

    Args:
        say: Function that takes the sentence.
        files: Expected number of files.
    """

    def __init__(self, say: Callable[[str], None], files: int) -> None:
        self._say, self._files = say, files
        self._begin = self._said = monotonic()
        self._kept = count_files()

    def on_start(self, _event: Any) -> None:
        """Do nothing when a kernel is begun."""

    def on_end(self, _event: Any) -> None:
        """Report progress when this process has compiled a kernel."""
        now = monotonic()
        if now - self._said < SAYS:
            return
        self._said = now
        took = now - self._begin
        self._say(time_left(count_files(), self._kept, self._files, took))


def count_files() -> int:
    """Number of kernels of both processes in the cache."""
    return sum(1 for _ in KERNEL_CACHE.rglob("*.nbc"))


def time_left(done: int, kept: int, files: int, took: float) -> str:
    """Sentence with the compiled share and the time left.

    Args:
        done: Files in the cache now.
        kept: Files in the cache at the start.
        files: Expected number of files.
        took: Time since the start [s].
    """
    done = min(done, files - 1)
    percent = 100 * done // files
    if done <= kept:
        return f"compiling kernels: {percent} %"
    left = took * (files - done) / (done - kept)
    return f"compiling kernels: {percent} %, about {left:.0f} s left"


def compile_ahead(
    progress: Callable[[str], None] | None, guarded: bool, try_out: TryOut
) -> None:
    """Compile here and in another process, unless the cache is complete.

    Numba compiles one kernel at a time. Two processes share the cache on disk: this one
    loads each kernel that the other one has compiled. This process compiles the
    distances and the cycle with fixed buffers, the other one the octree. They start the
    filter and the prediction of stops from opposite ends.

    Args:
        progress: Function that takes a sentence before the start, since compiling takes
            a minute or more, and then sentences with the time left.
        guarded: Whether stops are predicted; their kernels take as long again.
        try_out: Function that makes a guard of a scene and calls its kernels.
    """
    if numba.config.DISABLE_JIT or is_compiled(guarded):
        return
    with ExitStack() as stack:
        if progress is not None:
            minutes = "one or two minutes" if guarded else "a minute"
            progress(f"compiling kernels for this machine; first start only, {minutes}")
            left = TimeLeft(progress, GUARDED_FILES if guarded else FILES)
            stack.enter_context(event.install_listener("numba:compile", left))
        stack.enter_context(only_compiler())
        stack.enter_context(no_collections())
        if not is_compiled(guarded):
            compile_by_two(guarded, try_out)
            for ready in (READY, GUARDED_READY) if guarded else (READY,):
                (KERNEL_CACHE / ready).touch()


def compile_by_two(guarded: bool, try_out: TryOut) -> None:
    """Compile all kernels of a guard, half of them in another process if it can run."""
    if (os.cpu_count() or 1) < 2:
        compile_there(guarded, try_out)
        compile_here(guarded, try_out)
        return
    other = subprocess.Popen(
        [sys.executable, "-c", FIRST, str(os.getpid()), "-m", "armguard.respond"]
        + ["guarded"] * guarded,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        compile_here(guarded, try_out)
        other.wait(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        pass
    finally:
        if other.poll() is None:
            other.kill()
            other.wait()


def one_joint() -> RobotModel:
    """Smallest robot: one joint and one capsule."""
    rod = Capsule(start=(0.1, 0.0, 0.0), end=(0.4, 0.0, 0.0), radius=0.05)
    element = CollisionElement(geometry=rod, T_link_geometry=np.eye(4))
    return RobotModel(
        name="rod",
        path=None,
        links={
            "base": Link(name="base"),
            "rod": Link(name="rod", collisions=(element,)),
        },
        joints={
            "joint": Joint(
                name="joint",
                kind=JointKind.REVOLUTE,
                parent="base",
                child="rod",
                T_parent_joint=np.eye(4),
                axis=np.array([0.0, 0.0, 1.0]),
                lower=-1.0,
                upper=1.0,
                velocity=1.0,
            )
        },
        root="base",
    )


def compile_cycle(mode: Mode, try_out: TryOut) -> None:
    """Compile the cycle of a mode by guarding the smallest scene."""
    model = one_joint()
    scene = Scene(mode=mode)
    figures = stopping_figures(model, deceleration=4.0)
    scene.add_robot(model, name="rod", stopping=figures)
    scene.add(Sphere(radius=0.1), name="ball", pose=Pose(xyz=(0.0, 1.0, 0.0)))
    try_out(scene)


def compile_filter(last_first: bool) -> None:
    """Compile the filtered cycle and all kernels that it calls, see `link`."""
    first_there = () if last_first else kernels_from(run_cycle)
    link(run_filtered_cycle, last_first, later=first_there)
    lines, numbers = numba.int64[::1], numba.float64[::1]
    given = (numbers, numba.int64, numbers, lines, lines)
    entries: tuple[tuple[Any, tuple[Any, ...]], ...] = (
        (run_filtered_cycle, given),
        (begin_filtered_cycle, given),
        (end_filtered_cycle, (numbers, numba.int64, lines, lines)),
    )
    for kernel, arguments in entries:
        kernel.compile(arguments)


def compile_here(guarded: bool, try_out: TryOut) -> None:
    """Compile this process's part: distances, fixed buffers, half of the filter."""
    row, out = np.zeros(ROW_WIDTH), np.zeros(WITNESS_WIDTH)
    measure(int(ShapeKind.SPHERE), row, int(ShapeKind.SPHERE), row, out)
    compile_cycle("fixed", try_out)
    if guarded:
        compile_filter(last_first=True)


def compile_there(guarded: bool, try_out: TryOut) -> None:
    """Compile the other process's part: octree, half of the filter, paths."""
    if guarded:
        compile_filter(last_first=False)
    load_kernels()
    if guarded:
        compile_cycle("path", try_out)
