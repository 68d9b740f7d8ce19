"""`armguard report`: one page about a recording."""

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from armguard.cli.console import CLEAR, Json, out, print_json, progress_bar, say
from armguard.errors import StationError


def report(
    recording: Annotated[
        Path, Argument(help="A recording, a near miss, or a folder of recordings.")
    ],
    page: Annotated[
        Path | None,
        Option("--out", help="The page; beside the recording if this is not given."),
    ] = None,
    clearance: Annotated[
        float, Option(help="A pair with less left than this is a near miss [m].")
    ] = 0.0,
    slack: Annotated[
        float, Option(help="Less time than this until a stop is a near miss [s].")
    ] = 0.0,
    prove_seconds: Annotated[
        float,
        Option(min=0.0, help="Time for proofs that are not kept on this machine [s]."),
    ] = 0.0,
    json: Json = False,
) -> None:
    """Report a recording on one page that needs no network. Exit code 0, 2 bad input.

    With --json the findings are printed, and a page is written only with --out.
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
            closeness=Closeness(clearance, slack),
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
