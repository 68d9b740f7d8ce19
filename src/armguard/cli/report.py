"""`armguard report`: one page about a recording."""

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from armguard.cli.console import CLEAR, Json, out, print_json, progress_bar, say
from armguard.errors import StationError


def report(
    recording: Annotated[
        Path, Argument(help="Recording, near miss, or folder of recordings.")
    ],
    page: Annotated[
        Path | None,
        Option("--out", help="HTML file to write; beside the recording if left out."),
    ] = None,
    headroom: Annotated[
        float, Option(help="A pair with less headroom is a near miss [m].")
    ] = 0.0,
    time_left: Annotated[
        float, Option(help="Less time until a stop must be ordered is a near miss [s].")
    ] = 0.0,
    prove_seconds: Annotated[
        float,
        Option(min=0.0, help="Time for proofs that are not in the cache [s]."),
    ] = 0.0,
    json: Json = False,
) -> None:
    """Write a report about a recording, one HTML page.

    The page needs no network.

    With --json the findings are printed, and the page is written only with --out. Exit
    code 0, or 2 for bad input.
    """
    try:
        from armguard.recording import open_recording
        from armguard.report import Closeness, findings_of, write_page
        from armguard.report.page import advice, summary
    except ModuleNotFoundError as error:
        raise StationError(
            f"a report needs the package '{error.name}': pip install "
            "'armguard[station]'"
        ) from None

    found = open_recording(recording)
    with progress_bar("reading", int(found.info.get("cycles", 0))) as advance:
        findings = findings_of(
            found,
            closeness=Closeness(headroom, time_left),
            prove_seconds=prove_seconds,
            progress=advance,
        )
    if page is None and not json:
        folder = recording.is_dir()
        page = recording / "report.html" if folder else recording.with_suffix(".html")
    if page is not None:
        write_page(findings, page)
    if json:
        print_json(findings.to_dict())
    else:
        for problem in findings.problems:
            say(f"note: {problem}")
        out.print(summary(findings), markup=False)
        if sentence := advice(findings):
            out.print(sentence, markup=False)
        out.print(f"page written to {page}", markup=False)
    raise typer.Exit(CLEAR)
