"""`armguard demo`: a guard at work on simulated arms that an operator drives."""

import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from importlib.util import find_spec
from typing import Annotated, Any, Literal

import typer
from rich.console import Console
from rich.live import Live
from rich.text import Text
from typer import Option

from armguard.cli.console import (
    CLEAR,
    STYLES,
    TOO_CLOSE,
    Json,
    Verbose,
    compile_kernels,
    cycle_line,
    event_line,
    out,
    print_json,
    say,
)
from armguard.cli.demo_line import LineOperator
from armguard.errors import StationError
from armguard.guard import Level
from armguard.guard.events import Event
from armguard.guard.layout import IN_HEADER
from armguard.guard.levels import Reason
from armguard.processes import interrupted
from armguard.recording.frames import Frame, Kind, frame_of
from armguard.scene import compile_scene
from armguard.service.server.scenes import open_scene
from armguard.simulation.stage import Stage
from armguard.simulation.tally import LATE_REASONS, Tally, in_words

# Looks into the ring, and redraws of the status line, a second.
LOOKS = 20

# Period of the demo's cycles [s].
PERIOD = 0.004

# Permitted delay of a cycle: at least this, twice the delay measured at the start, and
# at most so much that simulated arms do not count the service as silent [s].
LATE, MOST_LATE = 0.03, 0.08

# Permitted age of states, beyond the permitted delay: drawing the page may take all
# there is of a machine [s].
STALE = 0.07

# Time for which the delay is measured [s].
MEASURED = 0.5

# Reason of cycles before the first cells of sensors have come.
CELLS_STALE = int(Reason.CELLS_STALE)

# Time until the first sentence on the waiting [s]; until each further one, it doubles.
SAYS = 5.0


def demo(
    scene: Annotated[
        Literal["bay", "two-pandas", "sensed-table", "conveyor"],
        Option(
            help="The paper's bay, two Pandas at a table, the same with sensors, or "
            "two Pandas that pick items from a conveyor, coordinated on line."
        ),
    ] = "bay",
    sense: Annotated[
        bool,
        Option(help="Scene sensed-table: simulated sensors see unknown boxes."),
    ] = False,
    response: Annotated[
        Literal["deflect", "slow", "stop"],
        Option(help="Response of the arms to near bodies."),
    ] = "deflect",
    headless: Annotated[
        bool, Option(help="Run in the terminal, without the page in the browser.")
    ] = False,
    seconds: Annotated[
        float | None,
        Option(min=0.1, help="Duration [s]; until interrupted if left out."),
    ] = None,
    seed: Annotated[
        int, Option(help="Seed of the operator's random motion, or of the items.")
    ] = 8,
    page_port: Annotated[int, Option(help="Port of the page.")] = 8080,
    verbose: Verbose = False,
    json: Json = False,
) -> None:
    """Guard two simulated arms that a careless operator drives.

    Service, arms and operator run as separate processes, as with real robots. In scene
    conveyor the operator is `armguard coordinate`. Exit code 0 if nothing touched, 1 if
    there was a contact.
    """
    scene = "sensed-table" if sense else scene
    say(f"starting a guard, simulated arms and an operator in '{scene}' ...")
    compile_kernels()
    # There a stop costs all jobs under way.
    late = MOST_LATE if scene == "conveyor" else permitted_delay(measured_delay())
    stale = STALE + late
    options = ["--response", response, "--late", str(late), "--stale", str(stale)]
    if scene == "sensed-table":
        check_sensors()
        options.append("--simulated-sensors")
    options.append("--no-self-test")
    line = None
    with interrupted() as ended, Stage(scene, *options) as stage, ExitStack() as rest:
        stage.start_service()
        made, *_ = open_scene(scene, period=PERIOD, late=late, stale=stale)
        tables = compile_scene(made)
        stage.wait_for_service(waiting(ended))
        stage.start_arms()
        if scene == "conveyor":
            log = subprocess.DEVNULL if json else rest.enter_context(passed_on())
            line = rest.enter_context(closing(LineOperator(stage, seed, log)))
        else:
            stage.start_operator(seed=seed)
        if not headless and not json:
            show_page(stage, page_port)
        tally = Tally(tables)
        reporter = Reporter(tally, verbose, quiet=json)
        watch(stage, tally, seconds, ended, reporter, line)
    answer: dict[str, Any] = {"scene": scene, **tally.summary()}
    if line is not None:
        answer["items"] = {"picked": line.done, "missed": line.missed}
    answer["exit_code"] = CLEAR if answer["touched"] is None else TOO_CLOSE
    if json:
        print_json(answer)
    else:
        for words in in_words(answer):
            out.print(words, markup=False)
        if line is not None:
            out.print(f"{line.done} items picked, {line.missed} missed")
    raise typer.Exit(answer["exit_code"])


def check_sensors() -> None:
    """Make sure that sensors can be simulated.

    Raises:
        StationError: MuJoCo is missing.
    """
    if find_spec("mujoco") is None:
        raise StationError(
            "sensors are simulated by MuJoCo; install it: pip install 'armguard[mjcf]'"
        )


def measured_delay() -> float:
    """Greatest delay of a process that sleeps for a period at a time [s]."""
    greatest, end = 0.0, time.monotonic() + MEASURED
    while (start := time.monotonic()) < end:
        time.sleep(PERIOD)
        greatest = max(greatest, time.monotonic() - start - PERIOD)
    return greatest


def permitted_delay(measured: float) -> float:
    """Delay of a cycle that the demo permits [s]; a greater one than usual is reported.

    Args:
        measured: Delay that was measured on this computer [s].
    """
    late = round(min(max(LATE, 2.0 * measured), MOST_LATE), 3)
    if late > LATE:
        say(
            f"this computer is busy: programs wake up to {measured * 1e3:.0f} ms late; "
            f"the demo permits cycles {late * 1e3:.0f} ms late instead of "
            f"{LATE * 1e3:.0f} ms, so its arms keep a greater distance"
        )
    return late


def waiting(ended: threading.Event) -> Callable[[float], None]:
    """Reports the waiting from time to time, and ends it at an interrupt.

    Args:
        ended: Set at an interrupt.
    """
    due = SAYS

    def wait(so_far: float) -> None:
        nonlocal due
        if ended.is_set():
            raise typer.Exit(CLEAR)
        if so_far >= due:
            due *= 2.0
            say(f"the service is starting, {so_far:.0f} s so far")

    return wait


class Reporter:
    """Prints events as they end, and once that the computer is too busy.

    Args:
        tally: Counts the cycles.
        verbose: Whether to print every change of level or nearest pair instead.
        quiet: Whether to print nothing.
    """

    def __init__(self, tally: Tally, verbose: bool, *, quiet: bool) -> None:
        self._tally, self._verbose, self.quiet = tally, verbose, quiet
        self._busy = False
        self._last: object = None

    def add(self, frame: Frame, console: Console) -> None:
        """Count a cycle, and print what is new."""
        event = self._tally.add(frame)
        if not self.quiet:
            self._report(event, console)

    def finish(self, console: Console) -> None:
        """Print the event that has not ended."""
        event = self._tally.log.finish()
        if event is not None and not self.quiet and not self._verbose:
            self._print(event, console)

    def _report(self, event: Event | None, console: Console) -> None:
        tally = self._tally
        if tally.too_busy and not self._busy:
            self._busy = True
            say(too_busy(tally))
        if event is not None and not self._verbose:
            self._print(event, console)
        verdict = tally.verdict
        if self._verbose and verdict is not None and verdict.level >= Level.SLOW:
            nearest = verdict.nearest
            sides = None if nearest is None else (nearest.a, nearest.b)
            if self._last != (verdict.level, sides):
                self._last = verdict.level, sides
                console.print(cycle_line(verdict, tally.log.start))

    def _print(self, event: Event, console: Console) -> None:
        """Print an event, but no stop that was ordered because of a late cycle."""
        if event.level < Level.STOP or event.reason not in LATE_REASONS:
            console.print(event_line(event, self._tally.log.start))


def too_busy(tally: Tally) -> str:
    """The meaning of the figures on a computer that runs cycles too late."""
    late = "a measurement or an answer came too late"
    if tally.delay > tally.late:
        late = (
            f"a cycle came {tally.delay * 1e3:.0f} ms late, "
            f"{tally.late * 1e3:.0f} ms are permitted"
        )
    return (
        f"this computer is too busy: {late}. Each such delay stops the arms, as it "
        "must; these stops are counted at the end and not listed. The figures are "
        "those of this busy computer: end other programs and start again"
    )


def watch(
    stage: Stage,
    tally: Tally,
    seconds: float | None,
    ended: threading.Event,
    reporter: Reporter,
    line: LineOperator | None,
) -> None:
    """Follow the frames of the guard, until time is up or an interrupt.

    Time counts from the first cycle, of a scene with sensors from the first one that
    has their cells, and of a conveyor from the start of the coordination.

    Raises:
        StationError: The service has ended.
    """
    reader = stage.frames()
    start, waits = None, True
    page = "view" in stage.crew
    with Live(console=out, refresh_per_second=LOOKS, transient=True) as live:
        while not ended.wait(1.0 / LOOKS):
            for row in reader.unread():
                frame = frame_of(row)
                if frame.kind is Kind.CYCLE:
                    waits = waits and frame.verdict[IN_HEADER.reason] == CELLS_STALE
                    if not waits:
                        reporter.add(frame, live.console)
            stage.check()
            if line is not None:
                line.check()
            page = page and page_lives(stage)
            if tally.verdict is None or not (line is None or line.works):
                live.update(
                    Text("waiting for the arms, their operator and sensors ...")
                )
                continue
            start = start or time.monotonic()
            so_far = time.monotonic() - start
            if not reporter.quiet:
                live.update(status(so_far, seconds, tally))
            if seconds is not None and so_far >= seconds:
                break
        reporter.finish(live.console)
    if reader.lost:
        say(f"{reader.lost} cycles are missing in this summary")
    reader.close()


def status(so_far: float, seconds: float | None, tally: Tally) -> Text:
    """The line that follows the motion."""
    verdict = tally.verdict
    assert verdict is not None
    stops = sum(tally.stops.values())
    share = 100.0 * tally.deflected / max(tally.cycles, 1)
    of = "" if seconds is None else f" of {seconds:.0f} s"
    text = (
        f"{so_far:6.1f} s{of}  {verdict.level.name:13} {stops} stops, "
        f"{share:.0f} % of commands changed  {tally.why}"
    )
    return Text(
        text, style=STYLES[verdict.level.name], overflow="ellipsis", no_wrap=True
    )


def show_page(stage: Stage, port: int) -> None:
    """Start the page, and print its lines; without it the demo goes on."""
    if find_spec("viser") is None:
        say("no page: it needs viser, pip install 'armguard[view]'")
        return
    words = ("--port", str(stage.port), "--page-port", str(port))
    with passed_on() as log:
        stage.crew.start("view", ("-m", "armguard", "view", *words), log=log)


@contextmanager
def passed_on() -> Iterator[int]:
    """Where processes may write to; their lines are printed, also later."""
    reading, writing = os.pipe()

    def pass_on() -> None:
        with os.fdopen(reading, encoding="utf-8", errors="replace") as lines:
            for line in lines:
                # A link that is broken into two lines cannot be clicked.
                out.print(line.rstrip(), markup=False, soft_wrap=True)

    threading.Thread(target=pass_on, name="lines", daemon=True).start()
    try:
        yield writing
    finally:
        os.close(writing)


def page_lives(stage: Stage) -> bool:
    """Whether the page is there; its end is reported once."""
    if stage.crew.lives("view"):
        return True
    code = stage.crew["view"].returncode
    say(f"the page has ended with code {code}; the demo goes on without it")
    return False
