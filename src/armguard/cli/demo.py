"""`armguard demo`: a guard at work on simulated arms that an operator drives."""

import os
import threading
import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Annotated, Any, Literal

import typer
from rich.live import Live
from rich.text import Text
from typer import Option

from armguard.cli.console import (
    CLEAR,
    STYLES,
    TOO_CLOSE,
    Json,
    event_line,
    out,
    print_json,
    say,
)
from armguard.guard import Level
from armguard.processes import interrupted
from armguard.recording.frames import Kind, frame_of
from armguard.scene import compile_scene
from armguard.service.server.scenes import open_scene
from armguard.simulation.stage import Stage
from armguard.simulation.tally import Tally, in_words

# Looks into the ring, and redraws of the status line, a second.
LOOKS = 20

# On a machine that does other things as well a cycle may come so late [s].
LATE = 0.03

# And states may be so old: drawing the page may take all there is of a machine [s].
STALE = 0.1

# A start that takes longer says so as often [s].
SAYS = 5.0


def demo(
    scene: Annotated[
        Literal["bay", "two-pandas"],
        Option(help="The paper's bay, or two Pandas at a table."),
    ] = "bay",
    response: Annotated[
        Literal["deflect", "slow", "stop"],
        Option(help="Response of the arms to near bodies."),
    ] = "deflect",
    headless: Annotated[
        bool, Option(help="In the terminal, without the page in the browser.")
    ] = False,
    seconds: Annotated[
        float | None, Option(min=0.1, help="How long; until interrupted if left out.")
    ] = None,
    seed: Annotated[int, Option(help="Seed of the operator's motion.")] = 8,
    page_port: Annotated[int, Option(help="Port of the page.")] = 8080,
    json: Json = False,
) -> None:
    """Guard two simulated arms that a careless operator drives.

    Service, arms and operator are separate processes, as they would be with real
    robots. Exit code 0 if nothing touched, 1 if something did.
    """
    say(f"starting a guard, simulated arms and an operator in '{scene}' ...")
    patience = ("--late", str(LATE), "--stale", str(STALE))
    options = ("--response", response, *patience, "--no-self-test")
    with interrupted() as ended, Stage(scene, *options) as stage:
        stage.start_service()
        tables = compile_scene(
            open_scene(scene, period=0.004, late=LATE, stale=STALE)[0]
        )
        stage.wait_for_service(waiting(ended))
        stage.start_arms()
        stage.start_operator(seed=seed)
        if not headless and not json:
            show_page(stage, page_port)
        tally = Tally(tables)
        watch(stage, tally, seconds, ended, quiet=json)
    answer: dict[str, Any] = {"scene": scene, **tally.summary()}
    answer["exit_code"] = CLEAR if answer["touched"] is None else TOO_CLOSE
    if json:
        print_json(answer)
    else:
        for line in in_words(answer):
            out.print(line, markup=False)
    raise typer.Exit(answer["exit_code"])


def waiting(ended: threading.Event) -> Callable[[float], None]:
    """Reports the waiting from time to time, and ends it at an interrupt.

    Args:
        ended: Set at an interrupt.
    """
    last = 0.0

    def wait(so_far: float) -> None:
        nonlocal last
        if ended.is_set():
            raise typer.Exit(CLEAR)
        if so_far - last >= SAYS:
            last = so_far
            say(
                f"waiting for the service, {so_far:.0f} s; the first start on a "
                "machine compiles for one or two minutes"
            )

    return wait


def watch(
    stage: Stage,
    tally: Tally,
    seconds: float | None,
    ended: threading.Event,
    *,
    quiet: bool,
) -> None:
    """Follow the frames of the guard, until time is up or an interrupt.

    Time counts from the first cycle.

    Raises:
        StationError: The service has ended.
    """
    reader = stage.frames()
    start = None
    page = "view" in stage.crew
    with Live(console=out, refresh_per_second=LOOKS, transient=True) as live:
        while not ended.wait(1.0 / LOOKS):
            for row in reader.unread():
                frame = frame_of(row)
                if frame.kind is not Kind.CYCLE:
                    continue
                event = tally.add(frame)
                if event is not None and not quiet and event.level >= Level.SLOW:
                    live.console.print(event_line(event))
            stage.check()
            page = page and page_lives(stage)
            if tally.verdict is None:
                live.update(Text("waiting for the arms and their operator ..."))
                continue
            start = start or time.monotonic()
            so_far = time.monotonic() - start
            if not quiet:
                live.update(status(so_far, tally))
            if seconds is not None and so_far >= seconds:
                break
    if reader.lost:
        say(f"{reader.lost} cycles were missed by this summary")
    reader.close()


def status(so_far: float, tally: Tally) -> Text:
    """The line that follows the motion."""
    verdict = tally.verdict
    assert verdict is not None
    stops = sum(tally.stops.values())
    share = 100.0 * tally.deflected / max(tally.cycles, 1)
    text = (
        f"{so_far:6.1f} s  {verdict.level.name:13} {stops} stops, otherwise than "
        f"asked {share:.0f} %  {tally.why}"
    )
    return Text(text, style=STYLES[verdict.level], overflow="ellipsis", no_wrap=True)


def show_page(stage: Stage, port: int) -> None:
    """Start the page, and print its lines; without it the demo goes on."""
    if find_spec("viser") is None:
        say("no page: it needs viser, pip install 'armguard[view]'")
        return
    reading, writing = os.pipe()
    words = ("--port", str(stage.port), "--page-port", str(port))
    stage.crew.start("view", ("-m", "armguard", "view", *words), log=writing)
    os.close(writing)

    def pass_on() -> None:
        with os.fdopen(reading, encoding="utf-8", errors="replace") as lines:
            for line in lines:
                # A link that is broken into two lines cannot be clicked.
                out.print(line.rstrip(), markup=False, soft_wrap=True)

    threading.Thread(target=pass_on, name="page's words", daemon=True).start()


def page_lives(stage: Stage) -> bool:
    """Whether the page is there; its end is reported once."""
    if stage.crew.lives("view"):
        return True
    code = stage.crew["view"].returncode
    say(f"the page has ended with code {code}; the demo goes on without it")
    return False
