"""Tests against mutants: one dry run notes what each test passes, then a fork for each.

A mutant's process is a fork of one that has run the tests before, so nothing is
compiled or loaded again and nothing it breaks outlives it. It runs the tests in which
the mutated value differs from the original at least once: in any other test the mutant
is the original.
"""

import json
import os
import shutil
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from numba.core.event import install_timer

from mutants.places import Mutant

# Unlike a test that hangs, one that only became slow is still a test [s], [-].
PATIENCE, SLOWER = 10.0, 10.0

# In a first round every mutant has so much time, for the shortest of its tests: most
# are killed in it [s].
QUICK = 1.5

# A test that waits and does not work is given up after this time of the clock [s].
ASLEEP = 300.0


@dataclass
class DryTest:
    """What a test did with every mutant off.

    Attributes:
        seconds: Time of the processor it took.
        passed: Numbers of mutants whose place it passed.
        differed: Those whose value differed.
        digest: Of its file.
        killed: Mutants it killed.
        tried: Mutants it was run against.
    """

    seconds: float
    passed: list[int]
    differed: list[int]
    digest: str
    killed: int = 0
    tried: int = 0

    def worth(self) -> float:
        """Kills to be expected in a second of its time."""
        return (self.killed + 0.5) / (self.tried + 5.0) / (self.seconds + 0.02)


@dataclass
class Outcome:
    """How a mutant fared.

    Attributes:
        outcome: "killed", "lives", "same" if no test made its value differ, "unreached"
            if none passed it, "unfit" if it is of a type that is not mutated.
        by: The test that killed it.
        how: "fails", "hangs" or "crashes".
        run: How many tests were run.
        tests: How many there are in which its value differs.
        seconds: Time of the processor they took.
        files: Their files.
        passed: Those of them that it lived through, with their digests.
    """

    outcome: str
    by: str = ""
    how: str = ""
    run: int = 0
    tests: int = 0
    seconds: float = 0.0
    files: list[str] = field(default_factory=list)
    passed: dict[str, str] = field(default_factory=dict)


class Trial:
    """A pytest plugin that runs its tests dry, and then against mutants.

    Args:
        switch: The module of the build with the switch and the marks.
        mutants: Which are tried, in this order.
        all_mutants: All that the build holds.
        dry: Where the dry run is kept; tests that are in it are not run dry again.
        digests: Digest of each test's file.
        passed: Files whose tests a mutant lived through already, with their digests.
        limit: Time of the processor a mutant's tests may take in all [s].
        workers: How many forks at once.
        report: Called with every outcome.
        say: Called with what goes on.
    """

    def __init__(
        self,
        switch: Any,
        mutants: Sequence[Mutant],
        all_mutants: Sequence[Mutant],
        dry: Path,
        digests: Mapping[str, str],
        passed: Mapping[str, Mapping[str, str]],
        limit: float,
        workers: int,
        report: Callable[[Mutant, Outcome], None],
        say: Callable[[str], None],
    ) -> None:
        self.switch, self.mutants, self.all = switch, mutants, all_mutants
        self.dry, self.limit, self.workers = dry, limit, workers
        self.digests, self.passed = digests, passed
        self.report, self.say = report, say
        self.tests: dict[str, DryTest] = {}
        self.unfit: set[int] = set()
        self.done: dict[str, set[str]] = {}
        self.failed = False
        self.why = ""

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Note whether a test failed."""
        if report.failed:
            self.failed = True
            self.why = report.longreprtext

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run the tests dry, then against every mutant."""
        if session.testsfailed or session.config.option.collectonly:
            return False
        items = {item.nodeid: item for item in session.items}
        self.run_dry(items)
        self.run_mutants(items)
        return True

    def run_test(self, item: Any) -> bool:
        """Run one test with fixtures of its own; whether it passes."""
        self.failed = False
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=None)
        return not self.failed

    def run_dry(self, items: dict[str, Any]) -> None:
        """Run every test with the switch off, or as many as warm this process up.

        Raises:
            pytest.UsageError: A test fails.
        """
        self.switch.chosen.value = -1
        kept = self.kept_dry()
        self.unfit = set(kept["unfit"])
        for name, one in kept["tests"].items():
            if name in items and one["digest"] == self.digests[file_of(name)]:
                self.tests[name] = DryTest(**one)
        by_file: dict[str, str] = {}
        for name in sorted(self.tests, key=lambda name: self.tests[name].seconds):
            by_file.setdefault(file_of(name), name)
        self.say(f"{len(self.tests)} tests are known, {len(by_file)} warm up")
        for name in by_file.values():
            self.run_test(items[name])
        todo = [name for name in items if name not in self.tests]
        for k, name in enumerate(todo):
            self.tests[name] = self.run_one_dry(name, items[name])
            if k % 25 == 24 or k + 1 == len(todo):
                self.say(f"dry run: {k + 1} of {len(todo)} tests, {name}")
                self.keep_dry()

    def run_one_dry(self, name: str, item: Any) -> DryTest:
        """Run a test with the switch off, again if it had to compile something."""
        switch, numbers = self.switch, [one.number for one in self.all]
        while True:
            switch.marks[numbers] = 0
            began, compiled = time.process_time(), []
            with install_timer("numba:compile", compiled.append):
                passes = self.run_test(item)
            if not passes:
                why = f"with no mutant on {name} fails:\n{self.why}"
                raise pytest.UsageError(why)
            seconds = time.process_time() - began
            if not compiled or seconds < 2.0:
                break
        marks = dict(zip(numbers, switch.marks[numbers].tolist(), strict=True))
        self.unfit |= {number for number in numbers if marks[number] & switch.UNFIT}
        return DryTest(
            seconds,
            [number for number in numbers if marks[number] & switch.PASSED],
            [number for number in numbers if marks[number] & switch.DIFFERED],
            self.digests[file_of(name)],
        )

    def keep_dry(self) -> None:
        """Keep the dry run for the next time, beside what others have kept."""
        kept = self.kept_dry()
        tests = {name: vars(test) for name, test in self.tests.items()}
        unfit = sorted(self.unfit.union(kept["unfit"]))
        new = self.dry.with_suffix(f".{os.getpid()}")
        new.write_text(json.dumps({"unfit": unfit, "tests": kept["tests"] | tests}))
        new.replace(self.dry)

    def kept_dry(self) -> dict[str, Any]:
        """What is kept of dry runs of this build."""
        if not self.dry.exists():
            return {"unfit": [], "tests": {}}
        kept: dict[str, Any] = json.loads(self.dry.read_text())
        return kept

    def run_mutants(self, items: dict[str, Any]) -> None:
        """Try every mutant, some at once."""
        threads = [
            t.name for t in threading.enumerate() if t is not threading.main_thread()
        ]
        if threads:
            raise pytest.UsageError(f"a fork would lose the threads {threads}")
        waiting = []
        for mutant in self.mutants:
            outcome = self.without_a_run(mutant)
            if outcome is None:
                waiting.append(mutant)
            else:
                self.report(mutant, outcome)
        for limit in (min(QUICK, self.limit), self.limit):
            self.say(f"{len(waiting)} mutants, {limit:g} s each at most")
            waiting = self.run_round(waiting, limit, items)

    def run_round(
        self, mutants: list[Mutant], limit: float, items: dict[str, Any]
    ) -> list[Mutant]:
        """Try mutants for a while each.

        Returns:
            Those that live and have not been run against all.
        """
        left: list[Mutant] = []
        waiting = list(mutants)
        running: dict[int, Fork] = {}
        while waiting or running:
            while waiting and len(running) < self.workers:
                mutant = waiting.pop(0)
                names = [n for n in self.order(mutant) if self.tests[n].seconds < limit]
                fork = Fork(self, mutant, names, items, limit)
                running[fork.pid] = fork
            for pid, fork in list(running.items()):
                if fork.ended():
                    del running[pid]
                    outcome = fork.outcome()
                    self.report(fork.mutant, outcome)
                    if outcome.outcome == "lives" and outcome.run < outcome.tests:
                        left.append(fork.mutant)
            time.sleep(0.05)
        return left

    def without_a_run(self, mutant: Mutant) -> Outcome | None:
        """What the dry run says of a mutant already."""
        if mutant.number in self.unfit:
            return Outcome("unfit")
        if not any(mutant.number in test.passed for test in self.tests.values()):
            return Outcome("unreached")
        return None if self.differing(mutant) else Outcome("same")

    def differing(self, mutant: Mutant) -> list[str]:
        """Tests in which a mutant's value differs from the original."""
        tests = self.tests.items()
        return [name for name, test in tests if mutant.number in test.differed]

    def order(self, mutant: Mutant) -> list[str]:
        """Those it has not lived through yet: most kills for their time first."""
        passed = self.passed.get(mutant.identity, {})
        names = [
            name
            for name in self.differing(mutant)
            if passed.get(file_of(name)) != self.digests[file_of(name)]
            and name not in self.done.get(mutant.identity, ())
        ]
        return sorted(names, key=lambda name: -self.tests[name].worth())


class Fork:
    """A process with one mutant on, which runs tests until one fails.

    It writes the place of each test to a pipe before it runs it, and how it ended.
    """

    def __init__(
        self,
        trial: Trial,
        mutant: Mutant,
        names: list[str],
        items: dict[str, Any],
        limit: float,
    ) -> None:
        self.trial, self.mutant, self.names = trial, mutant, names
        self.limit = limit
        self.home = Path(tempfile.mkdtemp(prefix="mutant"))
        read, write = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            os.close(read)
            self.work(write, items)
        os.close(write)
        os.set_blocking(read, False)
        self.read, self.heard, self.since = read, b"", time.monotonic()
        self.status = 0

    def work(self, pipe: int, items: dict[str, Any]) -> None:
        """Run the tests; never returns."""
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in range(3):
            os.dup2(nowhere, stream)
        # What a mutant writes to a cache is of no use.
        shared = Path(os.environ["ARMGUARD_CACHE"])
        for folder in shared.iterdir():
            if folder.is_dir() and not folder.name.startswith("kernels-"):
                shutil.copytree(folder, self.home / folder.name, copy_function=os.link)
        os.environ["ARMGUARD_CACHE"] = str(self.home)
        os.environ["ARMGUARD_MUTANT"] = str(self.mutant.number)
        self.trial.switch.chosen.value = self.mutant.number
        signal.signal(signal.SIGPROF, signal.SIG_DFL)
        ending = b"e"
        try:
            for k, name in enumerate(self.names):
                if time.process_time() > self.limit:
                    break
                os.write(pipe, b"%d\n" % k)
                most = PATIENCE + SLOWER * self.trial.tests[name].seconds
                signal.setitimer(signal.ITIMER_PROF, most)
                if not self.trial.run_test(items[name]):
                    ending = b"f"
                    break
        except BaseException:
            # pytest itself was ended: by an exit, or by what the mutant broke.
            ending = b"f"
        os.write(pipe, ending)
        os._exit(0)

    def ended(self) -> bool:
        """Whether it ended; one that sleeps is ended."""
        try:
            new = os.read(self.read, 65536)
        except BlockingIOError:
            new = b""
        if new:
            self.heard, self.since = self.heard + new, time.monotonic()
        if time.monotonic() - self.since > ASLEEP:
            os.kill(self.pid, signal.SIGKILL)
        pid, self.status, self.usage = os.wait4(self.pid, os.WNOHANG)
        if pid == 0:
            return False
        while rest := self.rest():
            self.heard += rest
        os.close(self.read)
        shutil.rmtree(self.home, ignore_errors=True)
        return True

    def rest(self) -> bytes:
        """What is left in the pipe."""
        try:
            return os.read(self.read, 65536)
        except BlockingIOError:
            return b""

    def outcome(self) -> Outcome:
        """How the mutant fared."""
        lines = self.heard.split(b"\n")
        run, ending = len(lines) - 1, lines[-1]
        tests, names = self.trial.tests, self.names
        for name in names[:run]:
            tests[name].tried += 1
        all_names = self.trial.differing(self.mutant)
        left = set(self.trial.order(self.mutant)).difference(names[:run])
        files = sorted(set(map(file_of, all_names)))
        done = set(files) - set(map(file_of, left))
        found = Outcome(
            "lives",
            run=len(all_names) - len(left),
            tests=len(all_names),
            seconds=round(self.usage.ru_utime + self.usage.ru_stime, 1),
            files=files,
            passed={file: self.trial.digests[file] for file in sorted(done)},
        )
        if ending == b"e":
            self.trial.done.setdefault(self.mutant.identity, set()).update(names[:run])
            return found
        found.outcome, found.how, found.passed = "killed", "fails", {}
        if ending != b"f":
            hangs = (signal.SIGPROF, signal.SIGKILL)
            signal_number = (
                os.WTERMSIG(self.status) if os.WIFSIGNALED(self.status) else 0
            )
            found.how = "hangs" if signal_number in hangs else "crashes"
        found.by = names[run - 1] if run else ""
        if found.by:
            tests[found.by].killed += 1
        return found


def file_of(name: str) -> str:
    """The file of a test."""
    return name.split("::", maxsplit=1)[0]


def tests_of(paths: Sequence[str]) -> Iterator[str]:
    """Arguments of pytest for a trial of these tests."""
    yield from ("-o", "addopts=", "--import-mode=importlib", "--assert=plain", "-s")
    yield from ("-o", "tmp_path_retention_policy=none")
    for plugin in ("cacheprovider", "terminal", "faulthandler", "xdist"):
        yield from ("-p", f"no:{plugin}")
    yield from paths
