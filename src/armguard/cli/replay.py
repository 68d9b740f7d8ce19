"""`armguard replay`: judge a recording again, the same way or with other settings."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from armguard.cli.console import (
    CLEAR,
    TOO_CLOSE,
    JsonOption,
    out,
    print_json,
    progress_bar,
    say,
)


def replay(
    recording: Annotated[
        Path,
        typer.Argument(help="A recording, a near miss, or a folder of recordings."),
    ],
    start: Annotated[
        float, typer.Option("--from", help="Begin at this time of it [s].")
    ] = 0.0,
    end: Annotated[
        float, typer.Option("--to", help="End at this time of it [s].")
    ] = np.inf,
    json: bool = JsonOption,
) -> None:
    """Judge every cycle of a recording again and compare the answers bit by bit.

    Exit codes: 0 all of them are the same, 1 one is different or none could be judged,
    2 there is no such recording.
    """
    from armguard.station.blackbox import open_recording
    from armguard.station.blackbox.replay import replay as judge_again

    found = open_recording(recording)
    with progress_bar("judging", int(found.info.get("cycles", 0))) as advance:
        answer = judge_again(found, start=start, end=end, progress=advance)
    code = CLEAR if answer.identical else TOO_CLOSE
    if json:
        print_json(
            {
                "recording": recording.name,
                **asdict(answer),
                "identical": answer.identical,
                "sentence": answer.sentence,
                "exit_code": code,
            }
        )
    else:
        for problem in answer.problems:
            say(f"note: {problem}")
        out.print(answer.sentence)
    raise typer.Exit(code)
