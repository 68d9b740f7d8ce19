"""`armguard replay`: judge a recording again, the same way or with other settings."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table
from typer import Argument, Option

from armguard.cli.console import (
    CLEAR,
    TOO_CLOSE,
    Json,
    out,
    print_json,
    progress_bar,
    say,
)
from armguard.errors import SceneError

# Stops a list shows; the JSON has them all.
SHOWN = 20


def replay(
    recording: Annotated[
        Path, Argument(help="Recording, near miss, or folder of recordings.")
    ],
    settings: Annotated[
        list[str] | None,
        Option(
            "--set",
            metavar="NAME=VALUE",
            help="Judge with another setting: guard.mode=speed, scene.buffer=0.01, "
            "response=slow, robots.left.response.kind=stop ...",
        ),
    ] = None,
    start: Annotated[
        float, Option("--from", help="Start time within the recording [s].")
    ] = 0.0,
    end: Annotated[
        float, Option("--to", help="End time within the recording [s].")
    ] = np.inf,
    json: Json = False,
) -> None:
    """Judge a recording again, and compare the results bit by bit.

    With --set the cycles are judged with other settings and compared with the recorded
    results. Exit codes: 0 all results are equal, 1 a result differs or no cycle could
    be judged, 2 the recording or a setting does not exist.
    """
    if settings:
        answer, code = compared(recording, by_name(settings), start, end)
    else:
        answer, code = replayed(recording, start, end)
    answer = {"recording": recording.name, **answer, "exit_code": code}
    if json:
        print_json(answer)
    else:
        for problem in answer["problems"]:
            say(f"note: {problem}")
        if settings:
            print_comparison(answer)
        else:
            out.print(answer["sentence"])
    raise typer.Exit(code)


def replayed(path: Path, start: float, end: float) -> tuple[dict[str, Any], int]:
    """The same once more: the answer, and the exit code."""
    from armguard.recording import open_recording
    from armguard.recording.replay import replay as judge_again

    recording = open_recording(path)
    with progress_bar("judging", recording.cycle_count) as advance:
        found = judge_again(recording, start=start, end=end, progress=advance)
    same = found.identical
    answer = {**asdict(found), "identical": same, "sentence": found.sentence}
    return answer, CLEAR if same else TOO_CLOSE


def compared(
    path: Path, settings: dict[str, str], start: float, end: float
) -> tuple[dict[str, Any], int]:
    """With other settings: the comparison, and the exit code."""
    from armguard.recording import open_recording
    from armguard.recording.comparison import compare

    recording = open_recording(path)
    with progress_bar("judging twice", recording.cycle_count) as advance:
        found = compare(recording, settings, start=start, end=end, progress=advance)
    same = found.cycles > 0 and found.first_difference is None
    return found.to_dict(), CLEAR if same else TOO_CLOSE


def by_name(settings: list[str]) -> dict[str, str]:
    """Values by name.

    Raises:
        SceneError: One is not written as NAME=VALUE.
    """
    found = {}
    for setting in settings:
        name, sign, value = setting.partition("=")
        if not sign or not name.strip() or not value.strip():
            raise SceneError(f"--set {setting}: write NAME=VALUE, as guard.mode=speed")
        found[name.strip()] = value.strip()
    return found


def print_comparison(answer: dict[str, Any]) -> None:
    """A comparison for people."""
    given = ", ".join(f"{name}={value}" for name, value in answer["settings"].items())
    table = Table(title=f"{answer['cycles']:,} cycles, recorded and with {given}")
    for column in ("", "recorded", "changed"):
        table.add_column(column, justify="left" if not column else "right")
    sides = answer["recorded"], answer["changed"]
    for level in sides[0]["seconds_at_level"]:
        seconds = [side["seconds_at_level"][level] for side in sides]
        if any(seconds):
            table.add_row(f"at {level}", *(f"{s:.3f} s" for s in seconds))
    table.add_row("stops", *(str(len(side["stops"])) for side in sides))
    table.add_row("slowed", *(str(side["slows"]) for side in sides))
    for name in ("least_headroom", "least_distance"):
        lengths = (millimetres(side[name]) for side in sides)
        table.add_row(name.replace("_", " "), *lengths)
    out.print(table)
    for title, key in (
        ("stops that these settings avoid", "stops_gone"),
        ("stops that these settings add", "stops_new"),
    ):
        stops = answer[key]
        if stops:
            out.print(f"{title}: {len(stops)}")
        for stop in stops[:SHOWN]:
            whose = f"{stop['robot']}: " if stop["robot"] else ""
            out.print(f"  {stop['time']:9.3f} s  {whose}{stop['why']}")
    first = answer["first_difference"]
    if first is None:
        out.print("no level and no command differs")
    else:
        at = f"cycle {first['cycle']:,} at {first['time']:.3f} s"
        out.print(f"first difference: {at}: {first['what']}")
    if others := answer["cycles_told_otherwise"]:
        out.print(f"other commands in {others:,} cycles")
    for refused in answer["refused"]:
        out.print(f"would have been refused: {refused}")
    say(answer["caveat"])


def millimetres(length: float) -> str:
    """A length for people."""
    return f"{length * 1e3:.1f} mm" if np.isfinite(length) else "nothing near"
