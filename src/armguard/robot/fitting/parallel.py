"""Fits on all cores: other processes of this interpreter fit beside this one.

A worker is started as a plain command and needs nothing of the main module, so it works
from scripts without a guard, `python -c` and notebooks. Where no process can be
started, or one ends, this process fits what is left.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from threading import Lock, Thread
from time import monotonic
from typing import IO, Any

from armguard.errors import ArmguardError
from armguard.robot.model import FittedLink, Link, MeshFile

Fit = Callable[..., FittedLink]

# Mesh bytes from which workers are worth their start, and time after which they are in
# any case [s].
WORTH = 500_000
PATIENCE = 1.0

WORKER = """
import sys
sys.path[:] = {path!r}
from armguard.robot.fitting.parallel import work
work()
"""


def weight(link: Link) -> int:
    """Size of a link's mesh files, by which the longest fits begin first [byte]."""
    shapes = [element.geometry for element in link.collisions]
    return sum(s.path.stat().st_size for s in shapes if isinstance(s, MeshFile))


def core_count() -> int:
    """Cores this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass
class Fits:
    """Links to fit, shared by this process and the threads that feed the others.

    Attributes:
        fit: Fits a link.
        waiting: Links that no process fits yet, the longest last.
        settings: Keyword arguments of `fit`.
        started: Called as a fit begins.
        finished: Called with each fit.
        done: Fits by link name.
        errors: Links that cannot be fitted.
    """

    fit: Fit
    waiting: list[Link]
    settings: dict[str, Any]
    started: Callable[[str], None]
    finished: Callable[[FittedLink], None]
    done: dict[str, FittedLink] = field(default_factory=dict)
    errors: list[ArmguardError] = field(default_factory=list)
    lock: Lock = field(default_factory=Lock)

    def take(self) -> Link | None:
        """The next link, None if there is none or one failed."""
        with self.lock:
            if not self.waiting or self.errors:
                return None
            link = self.waiting.pop()
            self.started(link.name)
            return link

    def keep(self, link: Link, answer: FittedLink | ArmguardError) -> None:
        """Keep a fit, or the error in its place."""
        if isinstance(answer, FittedLink):
            self.done[link.name] = answer
            self.finished(answer)
        else:
            self.errors.append(answer)

    def run_here(self, enough: Callable[[], bool]) -> None:
        """Fit links in this process until none waits or there is another reason."""
        while not enough() and (link := self.take()) is not None:
            self.keep(link, attempt(self.fit, link, self.settings))

    def run_there(self, process: "subprocess.Popen[bytes]") -> None:
        """Fit links in a worker; what it leaves goes back to the others."""
        assert process.stdin is not None and process.stdout is not None
        while (link := self.take()) is not None:
            try:
                send(process.stdin, (self.fit, link, self.settings))
                answer = pickle.load(process.stdout)
            except (OSError, EOFError, pickle.PickleError, AttributeError):
                with self.lock:
                    self.waiting.append(link)
                return
            self.keep(link, answer)


def fit_links(
    fit: Fit,
    links: Sequence[Link],
    settings: dict[str, Any],
    started: Callable[[str], None],
    finished: Callable[[FittedLink], None],
) -> dict[str, FittedLink]:
    """Fits by link name, each the same as `fit` makes in this process.

    Args:
        fit: A function of a module, of a link and these settings.
        links: The links.
        settings: Its keyword arguments.
        started: Called with a link's name as its fit begins, by one thread at a time.
        finished: Called with each fit, in the thread that has it.

    Raises:
        ModelError: A link cannot be fitted.
    """
    fits = Fits(fit, sorted(links, key=weight), settings, started, finished)
    spare, begin = min(core_count(), len(links)) - 1, monotonic()
    heavy = sum(map(weight, links)) > WORTH
    fits.run_here(lambda: spare > 0 and (heavy or monotonic() > begin + PATIENCE))
    processes = [p for _ in range(spare) if fits.waiting and (p := start()) is not None]
    threads = [Thread(target=fits.run_there, args=(p,)) for p in processes]
    try:
        for thread in threads:
            thread.start()
        fits.run_here(lambda: False)
        for process, thread in zip(processes, threads, strict=True):
            thread.join()
            end(process)
        fits.run_here(lambda: False)
    finally:
        for process in processes:
            process.kill()
            process.wait()
    if fits.errors:
        raise fits.errors[0]
    return fits.done


def start() -> "subprocess.Popen[bytes] | None":
    """A worker, None where there can be none."""
    if not sys.executable:
        return None
    try:
        return subprocess.Popen(
            [sys.executable, "-c", WORKER.format(path=sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            # Threads of BLAS would wait for work on the cores of the other fits.
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )
    except OSError:
        return None


def end(process: "subprocess.Popen[bytes]") -> None:
    """Close the pipes of a worker, which ends it."""
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()


def work() -> None:
    """Fit what arrives on standard input until it ends; answers to standard output."""
    answers, sys.stdout = sys.stdout.buffer, sys.stderr
    while True:
        try:
            fit, link, settings = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        send(answers, attempt(fit, link, settings))


def attempt(
    fit: Fit, link: Link, settings: dict[str, Any]
) -> FittedLink | ArmguardError:
    """The fit of a link, or why there is none."""
    try:
        return fit(link, **settings)
    except ArmguardError as error:
        return error


def send(pipe: IO[bytes], what: object) -> None:
    """Write one object to a pipe."""
    pickle.dump(what, pipe)
    pipe.flush()
