"""The one start in which kernels have to be compiled: said before, and done by two.

Of several programs that start at once one compiles, and the others wait for it: each
would do the same work, and all would take as long as all of it.
"""

import fcntl
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
from armguard.index.small_tree import compile_octree
from armguard.kernel import KERNEL_CACHE, READY_CODE
from armguard.respond.whole_cycle import (
    begin_filtered_cycle,
    end_filtered_cycle,
    run_filtered_cycle,
)
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from armguard.robot.stopping import stopping_figures
from armguard.scene.scene import Scene
from armguard.scene.settings import Mode
from armguard.separate import link

# Makes a guard of a scene, and calls what its cycles call.
TryOut = Callable[[Scene], None]

# Longest the other process is waited for [s]; without it this one compiles all.
PATIENCE = 600.0

# Written to the cache when all is there that a guard needs, without and with stops.
READY = "fixed.ready"
GUARDED_READY = "guarded.ready"

# Roughly how many files that are, without and with stops.
FILES, GUARDED_FILES = 280, 700

# Between two such sentences [s].
SAYS = 10.0

# Held by who compiles. It is let go of when he ends, however he does.
LOCK = "compiling.lock"


def is_compiled(guarded: bool) -> bool:
    """Whether a guard's machine code came with the wheel or lies in the cache."""
    return (
        READY_CODE is not None
        or (KERNEL_CACHE / (GUARDED_READY if guarded else READY)).exists()
    )


@contextmanager
def only_compiler() -> Iterator[None]:
    """Wait until nobody else compiles into this cache."""
    KERNEL_CACHE.mkdir(parents=True, exist_ok=True)
    with (KERNEL_CACHE / LOCK).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX)
        except OSError:
            # A folder that knows no locks: work may be done twice.
            pass
        yield


class TimeLeft(event.Listener):  # type: ignore[misc]
    """Says now and then, between two kernels, how much is compiled.

    Args:
        say: Is given the sentence.
        files: How many files there will be.
    """

    def __init__(self, say: Callable[[str], None], files: int) -> None:
        self._say, self._files = say, files
        self._begin = self._said = monotonic()
        self._kept = count_files()

    def on_start(self, _event: Any) -> None:
        """Nothing: a kernel is begun."""

    def on_end(self, _event: Any) -> None:
        """A kernel is compiled, here."""
        now = monotonic()
        if now - self._said < SAYS:
            return
        self._said = now
        took = now - self._begin
        self._say(time_left(count_files(), self._kept, self._files, took))


def count_files() -> int:
    """How many kernels are kept, of both processes."""
    return sum(1 for _ in KERNEL_CACHE.rglob("*.nbc"))


def time_left(done: int, kept: int, files: int, took: float) -> str:
    """How much is compiled, and how long the rest will take.

    Args:
        done: Files there are.
        kept: Files there were.
        files: Files there will be.
        took: What those between have taken [s].
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
    """Compile here and in another process, unless all is kept.

    Numba compiles one kernel at a time. Two processes share the cache on disk: what the
    other one has compiled is loaded when this one comes to it. Here go the distances
    and the cycle with fixed buffers, there the octree; the filter and the prediction of
    stops are begun at both ends.

    Args:
        progress: Given a sentence before, since it takes a minute or more, and now and
            then how much is left.
        guarded: Whether stops are to be predicted; their kernels take as long again.
        try_out: Makes a guard of a scene, and calls what its cycles call.
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
        if not is_compiled(guarded):
            compile_by_two(guarded, try_out)
            for ready in (READY, GUARDED_READY) if guarded else (READY,):
                (KERNEL_CACHE / ready).touch()


def compile_by_two(guarded: bool, try_out: TryOut) -> None:
    """Compile all a guard needs: half of it in another process, if there is a core."""
    if (os.cpu_count() or 1) < 2:
        compile_there(guarded, try_out)
        compile_here(guarded, try_out)
        return
    other = subprocess.Popen(
        [sys.executable, "-m", "armguard.respond", *["guarded"] * guarded],
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
    """The smallest robot there is."""
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
    """Guard the smallest scene for a cycle."""
    model = one_joint()
    scene = Scene(mode=mode)
    figures = stopping_figures(model, deceleration=4.0)
    scene.add_robot(model, name="rod", stopping=figures)
    scene.add(Sphere(radius=0.1), name="ball", pose=Pose(xyz=(0.0, 1.0, 0.0)))
    try_out(scene)


def compile_filter(last_first: bool) -> None:
    """Compile the filtered cycle and all that it calls, see `link`."""
    link(run_filtered_cycle, last_first)
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
    """The part of a guard that starts: distances, fixed buffers, half of the filter."""
    row, out = np.zeros(ROW_WIDTH), np.zeros(WITNESS_WIDTH)
    measure(int(ShapeKind.SPHERE), row, int(ShapeKind.SPHERE), row, out)
    compile_cycle("fixed", try_out)
    if guarded:
        compile_filter(last_first=True)


def compile_there(guarded: bool, try_out: TryOut) -> None:
    """The part of the other process: the octree, half of the filter, paths."""
    compile_octree()
    if guarded:
        compile_filter(last_first=False)
        compile_cycle("path", try_out)
