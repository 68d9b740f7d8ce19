"""`armguard fleet`: audits, proofs, replays and closed loops, by many workers."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from armguard.cli.console import (
    BAD_INPUT,
    CLEAR,
    TOO_CLOSE,
    Json,
    bars,
    loading_bar,
    out,
    plain_table,
    print_json,
    say,
    with_options,
)
from armguard.errors import StationError

if TYPE_CHECKING:
    from armguard.fleet.job import JobModel
    from armguard.fleet.manifest import Manifest
    from armguard.fleet.run import Outcome
    from armguard.fleet.worker import Receipt

fleet = typer.Typer(
    help="Audit, prove, replay or execute many motions with many workers. Exit codes: "
    "0 nothing found, 1 something found, 2 an input or the job is wrong.",
    no_args_is_help=True,
    rich_markup_mode=None,
    add_completion=False,
)

# Rows of a query that are printed; the JSON has all.
SHOWN = 1000

# Files of TLS.
Ca = Annotated[Path | None, Option("--tls-ca", help="Certificates that are trusted.")]
Cert = Annotated[Path | None, Option("--tls-cert", help="The own certificate.")]
Key = Annotated[Path | None, Option("--tls-key", help="The key of the certificate.")]

Results = Annotated[Path, Argument(help="Folder of the results.")]


@dataclass(frozen=True, kw_only=True)
class Options:
    """The command line of a job."""

    inputs: Annotated[
        list[Path],
        Argument(
            help="A job file, or inputs: LeRobot datasets, recordings, plans, "
            "folders of them, and for `run` random:FIRST-LAST."
        ),
    ]
    scene: Annotated[
        list[Path] | None, Option(help="Scene file; repeat it for several.")
    ] = None
    out: Annotated[
        Path, Option(help="Folder of the results; the same command goes on there.")
    ] = Path("fleet-results")
    sweep: Annotated[
        list[str] | None,
        Option(
            "--set",
            metavar="NAME=VALUE,VALUE",
            help="Values of a setting, each of which is judged; repeat it for each.",
        ),
    ] = None
    units: Annotated[
        str, Option(help="Unit of joint positions in datasets: radians or degrees.")
    ] = "radians"
    hold_home: Annotated[
        bool, Option(help="Hold joints without a column at their home position.")
    ] = False
    guard: Annotated[
        bool, Option(help="Judge each frame of an audit by the guard as well.")
    ] = True
    duration: Annotated[
        float | None,
        Option(min=1e-3, help="Longest time of an episode of `run` [s]."),
    ] = None
    workers: Annotated[
        int, Option(min=0, help="Worker processes; 0 is one, in this process.")
    ] = 0
    address: Annotated[
        str | None, Option(help="Scheduler of a Dask cluster, tcp://127.0.0.1:8786.")
    ] = None
    tls_ca: Ca = None
    tls_cert: Cert = None
    tls_key: Key = None
    json: Json = False


@fleet.command()
@with_options(Options)
def audit(options: Options) -> None:
    """Audit recorded episodes: contacts, limits, jumps, frozen joints, offsets."""
    do(options, "audit")


@fleet.command()
@with_options(Options)
def verify(options: Options) -> None:
    """Prove plans, each in every scene and with every setting."""
    do(options, "verify")


@fleet.command()
@with_options(Options)
def replay(options: Options) -> None:
    """Judge recordings again, the same way or with other settings."""
    do(options, "replay")


@fleet.command()
@with_options(Options)
def run(options: Options) -> None:
    """Run motions in closed loops of the guard and simulated arms.

    Exit code 1: a pair came nearer than its buffer. Random motions are random:0-999.
    """
    do(options, "run")


@fleet.command()
def query(
    results: Results,
    sql: Annotated[str, Argument(help="Query of DuckDB: results, findings.")],
    json: Json = False,
) -> None:
    """Answer a query about results, such as "select kind, count(*) from findings …"."""
    check_packages()
    from armguard.fleet.store import query as answer

    names, rows = answer(results, sql)
    if json:
        found = [dict(zip(names, map(plain, row), strict=True)) for row in rows]
        print_json({"rows": found})
        return
    table = plain_table(*names)
    for row in rows[:SHOWN]:
        table.add_row(*map(str, row))
    out.print(table, markup=False)
    if len(rows) > SHOWN:
        out.print(f"… and {len(rows) - SHOWN} more rows; --json has all")


@fleet.command()
def report(
    results: Results,
    page: Annotated[
        Path | None, Option("--out", help="HTML file; in the folder if left out.")
    ] = None,
) -> None:
    """Write a page about results: worst inputs, plots, and how to open them."""
    check_packages()
    from armguard.fleet.report import write_report

    path = results / "report.html" if page is None else page
    write_report(results, path)
    out.print(f"page written to {path}", markup=False)


@fleet.command()
def view(
    results: Results,
    item: Annotated[int, Argument(min=0, help="Number of the result.")],
    page_port: Annotated[
        int, Option(help="Port of the page; 0 for a free one.")
    ] = 8080,
) -> None:
    """Show a result in the browser, as the guard judges its frames."""
    check_packages()
    if find_spec("viser") is None:
        raise StationError("the view needs viser: pip install 'armguard[view]'")
    from armguard.fleet.playback import item_frames
    from armguard.view.__main__ import show
    from armguard.view.recorded_view import RecordedView

    scene, frames = item_frames(results, item)
    show(RecordedView(scene, frames, page_port))


@fleet.command()
def scheduler(
    host: Annotated[str, Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, Option(help="Port to listen on; 0 for a free one.")] = 8786,
    tls_ca: Ca = None,
    tls_cert: Cert = None,
    tls_key: Key = None,
) -> None:
    """Start the scheduler of a cluster. Its first line is the address of workers."""
    check_packages()
    from armguard.fleet.cluster import schedule

    schedule(host, port, tls_of(tls_ca, tls_cert, tls_key))


@fleet.command()
def worker(
    address: Annotated[str, Argument(help="Scheduler, as in tcp://127.0.0.1:8786.")],
    tls_ca: Ca = None,
    tls_cert: Cert = None,
    tls_key: Key = None,
) -> None:
    """Start a worker of a cluster; it does one part of the work at a time."""
    check_packages()
    from armguard.fleet.cluster import work

    work(address, tls_of(tls_ca, tls_cert, tls_key))


def do(options: Options, work: str) -> None:
    """Do a job, or what is missing of it."""
    check_packages()
    from armguard.fleet.engine import engine_of
    from armguard.fleet.manifest import Manifest
    from armguard.fleet.run import run_job

    job, folder = job_of(options)
    tls = tls_of(options.tls_ca, options.tls_cert, options.tls_key)
    engine = engine_of(options.workers, options.address, tls)
    with loading_bar() as progress:
        manifest = Manifest.of(work, job, folder, progress)
    with receipts_bar(work, manifest) as show:
        outcome = run_job(manifest, options.out.resolve(), engine, show)
    if options.json:
        print_json({"work": work, "out": str(options.out), **asdict(outcome)})
    else:
        show_outcome(options.out, outcome)
    if outcome.failed:
        raise typer.Exit(BAD_INPUT)
    # A stop in a closed loop is what the guard is for.
    good = outcome.clear == outcome.items and (work == "run" or not outcome.found)
    raise typer.Exit(CLEAR if good else TOO_CLOSE)


def check_packages() -> None:
    """Refuse to begin without the packages of fleets.

    Raises:
        StationError: One is missing.
    """
    for name in ("duckdb", "distributed", "jinja2", "plotly", "mcap"):
        if find_spec(name) is None:
            raise StationError(
                f"a fleet needs the package '{name}': pip install 'armguard[fleet]'"
            )


def job_of(options: Options) -> "tuple[JobModel, Path]":
    """The job of a command line, and the folder its paths lead from."""
    from armguard.fleet.job import FleetError, JobModel, read_job

    first = options.inputs[0]
    if options.scene is None and first.suffix in (".yaml", ".yml"):
        if len(options.inputs) > 1 or options.sweep:
            raise FleetError(f"{first} is a job; give inputs and settings in it")
        return read_job(first), first.parent.resolve()
    sweep: dict[str, list[str | float | bool]] = {}
    for text in options.sweep or ():
        name, sign, values = text.partition("=")
        if not sign or not name or not values:
            raise FleetError(f"--set {text}: write NAME=VALUE or NAME=VALUE,VALUE")
        sweep[name] = [*values.split(",")]
    if options.units not in ("radians", "degrees"):
        raise FleetError(f"--units {options.units}: give radians or degrees")
    job = JobModel.model_validate(
        {
            "inputs": [str(path) for path in options.inputs],
            "scenes": [str(path) for path in options.scene or ()],
            "sweep": sweep,
            "units": options.units,
            "hold_home": options.hold_home,
            "guard": options.guard,
            "duration": options.duration,
        }
    )
    return job, Path.cwd()


def tls_of(ca: Path | None, cert: Path | None, key: Path | None) -> Any:
    """Files of TLS; None if none is given.

    Raises:
        FleetError: Some are given, and not all.
    """
    from armguard.fleet.engine import Tls
    from armguard.fleet.job import FleetError

    if ca is None and cert is None and key is None:
        return None
    if ca is None or cert is None or key is None:
        raise FleetError("give all of --tls-ca, --tls-cert and --tls-key, or none")
    return Tls(ca, cert, key)


@contextmanager
def receipts_bar(
    work: str, manifest: "Manifest"
) -> "Iterator[Callable[[Receipt], None]]":
    """A bar with what is done, what failed, and the worst so far."""
    failed, found, worst = 0, 0, (float("inf"), "")
    with bars() as progress:
        task = progress.add_task(work, total=manifest.items)

        def show(receipt: "Receipt") -> None:
            nonlocal failed, found, worst
            failed, found = failed + receipt.failed, found + receipt.found
            if receipt.least is not None:
                worst = min(worst, (receipt.least, receipt.worst))
            words = f"{work}: {found} with findings, {failed} failed"
            if worst[1]:
                words += f", least {1e3 * worst[0]:.1f} mm in {worst[1]}"
            progress.update(task, advance=receipt.items, description=words)

        yield show


def show_outcome(folder: Path, outcome: "Outcome") -> None:
    """Print what came of a job."""
    if outcome.before:
        say(f"{outcome.before} of {outcome.shards} parts were done before")
    out.print(
        f"{outcome.items} results: {outcome.clear} clear, {outcome.found} with "
        f"findings, {outcome.failed} could not be judged",
        markup=False,
    )
    out.print(
        f"in {folder}; `armguard fleet report {folder}` writes a page of them",
        markup=False,
    )


def plain(value: Any) -> Any:
    """A value of a table as JSON has it."""
    known = isinstance(value, bool | int | float | str | list | dict | None)
    return value if known else str(value)
