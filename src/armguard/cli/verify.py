"""`armguard verify`: prove whole plans before anything moves."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from typer import Option

from armguard.cli.console import (
    CLEAR,
    TOO_CLOSE,
    Json,
    RobotOption,
    loading_bar,
    out,
    print_json,
    say,
    with_options,
)
from armguard.errors import StationError, TrajectoryError
from armguard.plans.certificate import Certificate
from armguard.plans.pieces import Piece, spans, write_pieces
from armguard.plans.plan import Plan
from armguard.plans.proof import PlanProof
from armguard.plans.recheck import recheck
from armguard.plans.splines import DEGREES, Interpolation
from armguard.plans.verify import PlanVerifier
from armguard.recording.motions import load_motion
from armguard.scene import Scene, load_scene
from armguard.scene.compile import compile_scene

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Options:
    """The command line."""

    plans: Annotated[
        list[Path],
        typer.Argument(
            help="Plans: CSV with joint names, NPZ, NPY, a trajectory of ROS in YAML "
            "or JSON, a bag, or a recording of armguard."
        ),
    ]
    scene: Annotated[Path, Option(help="Scene file.")]
    recheck: Annotated[
        bool,
        Option(
            help="The files are certificates: confirm them with Coal and Pinocchio, "
            "and with no line of what proved them."
        ),
    ] = False
    certificate: Annotated[
        Path | None, Option(help="NPZ file to write, with every tile of the proof.")
    ] = None
    sweep: Annotated[
        Path | None,
        Option(
            help="GLB, STL or PLY file to write: all that the links pass through, with "
            "the declared errors."
        ),
    ] = None
    sweep_relative_to: Annotated[
        str | None,
        Option(
            help="ROBOT/LINK: sweep the links that are checked against it in its "
            "frame, and list when it may meet what they sweep there."
        ),
    ] = None
    view: Annotated[
        bool,
        Option(
            help="Show the plan in the browser: the scene, the sweep of each robot, "
            "and a time line that moves the robots."
        ),
    ] = False
    page_port: Annotated[int, Option(help="Port of that page; 0 for a free one.")] = (
        8080
    )
    sweep_tolerance: Annotated[
        float, Option(help="How far the sweep may reach beyond that, about [m].")
    ] = 0.005
    interpolation: Annotated[
        str | None,
        Option(
            help="What the controllers make of the rows: linear, cubic or quintic. By "
            "default as in the trajectory controller of ROS: by the velocities and "
            "accelerations that the rows have."
        ),
    ] = None
    following_error: Annotated[
        list[str] | None,
        Option(
            help="How far joints may be off the plan [rad or m]: a number, or "
            "ROBOT=NUMBER or ROBOT/JOINT=NUMBER; repeat it for each."
        ),
    ] = None
    skew: Annotated[
        list[str] | None,
        Option(
            help="How far the clocks of robots may be off [s]: a number, or "
            "ROBOT=NUMBER; repeat it for each."
        ),
    ] = None
    moved: Annotated[
        list[str] | None,
        Option(
            help="An object that moved since the plans were proven: only its pairs are "
            "proven again; repeat it for each."
        ),
    ] = None
    start: Annotated[
        str | None,
        Option(
            help="Where the arms rest before: 'home', or the last row of a file. "
            "The way from there to the first row is proven too."
        ),
    ] = None
    hold_home: Annotated[
        bool, Option(help="Hold joints that a plan lacks at their home position.")
    ] = False
    robot: RobotOption = None
    json: Json = False


@with_options(Options)
def verify(options: Options) -> None:
    """Prove that plans keep every buffer, or list when which pair does not.

    Exit code 0 proven, 1 a plan comes too near, 2 bad input.
    """
    with loading_bar() as progress:
        scene = load_scene(options.scene, robot=options.robot, progress=progress)
    if options.recheck:
        recheck_all(options.plans, scene)
        return
    kind = interpolation_of(options.interpolation)
    errors = named_numbers("--following-error", options.following_error)
    skew = named_numbers("--skew", options.skew)
    start = start_of(options.start, scene)
    plans = [
        Plan.read(
            path,
            scene,
            interpolation=kind,
            start=start,
            hold_home=options.hold_home,
        )
        for path in options.plans
    ]
    verifier = PlanVerifier(scene, moved=options.moved or ())
    proofs = [
        verifier.verify(plan, following_error=errors, skew=skew) for plan in plans
    ]
    if options.certificate is not None:
        if len(plans) > 1:
            raise TrajectoryError("a certificate is of one plan; give one")
        if errors or skew:
            raise TrajectoryError(
                "a certificate is of the curves alone; leave out the following error "
                "and the skew"
            )
        verifier.certificate(plans[0]).write(options.certificate)
    pieces, met = sweep_of(plans, verifier, options)
    if options.json:
        answer = answer_of(options.scene.name, proofs)
        if met is not None:
            answer["met"] = [asdict(one) for one in spans(met)]
        print_json(answer)
    else:
        for proof in proofs:
            for note in proof.notes:
                say(f"note: {note}")
            out.print(proof.sentence, markup=False)
        if met is not None:
            for line in met_lines(met, options.sweep_relative_to, plans[0].timed):
                out.print(line, markup=False)
    if options.view:
        show_plan(scene, plans[0], proofs[0], (pieces, met or []), options)
    raise typer.Exit(CLEAR if all(proof.clear for proof in proofs) else TOO_CLOSE)


def sweep_of(
    plans: list[Plan], verifier: PlanVerifier, options: Options
) -> tuple[list[Piece], list[Piece] | None]:
    """Write the sweep; its pieces, and those that the link meets which it is about.

    Raises:
        TrajectoryError: There are several plans, or the file is of another kind.
        StationError: Viser is not installed.
    """
    link = options.sweep_relative_to
    if options.sweep is None and link is None and not options.view:
        return [], None
    if len(plans) > 1:
        raise TrajectoryError("a sweep is of one plan; give one")
    if options.view and find_spec("viser") is None:
        raise StationError("the view needs viser: pip install 'armguard[view]'")
    pieces = verifier.sweep(
        plans[0],
        following_error=named_numbers("--following-error", options.following_error),
        skew=named_numbers("--skew", options.skew),
        tolerance=options.sweep_tolerance,
        relative_to=link,
    )
    if options.sweep is not None:
        write_pieces(pieces, options.sweep)
    return pieces, None if link is None else verifier.meeting(pieces, link)


def show_plan(
    scene: Scene,
    plan: Plan,
    proof: PlanProof,
    swept: tuple[list[Piece], list[Piece]],
    options: Options,
) -> None:
    """Show a plan with its sweep in the browser, until the process is ended.

    Args:
        scene: The scene.
        plan: The plan.
        proof: What is proven of it.
        swept: The pieces of its sweep, and those that the link meets.
        options: The command line.
    """
    from armguard.view.__main__ import show
    from armguard.view.planned_view import PlannedView

    pieces, met = swept
    view = PlannedView(
        *(scene, plan, proof, pieces),
        relative_to=options.sweep_relative_to,
        met=met,
        page_port=options.page_port,
    )
    show(view)


def met_lines(met: list[Piece], link: str | None, timed: bool) -> Iterator[str]:
    """When a link may touch those that are checked against it, one line for each."""
    unit = " s" if timed else ""
    if not met:
        yield f"  {link} never touches a moving link that is checked against it"
    for one in spans(met):
        times = f"{one.start:.4f}{unit} to {one.end:.4f}{unit}"
        yield f"  {link} meets what {one.link} sweeps in its frame: {times}"


def recheck_all(paths: list[Path], scene: Scene) -> None:
    """Confirm certificates; exit code 1 if one leaves a pair open.

    Raises:
        CertificateError: One cannot be confirmed.
    """
    tables = compile_scene(scene)
    open_still = 0
    for path in paths:
        found = recheck(Certificate.read(path), tables)
        open_still += found.open
        out.print(
            f"{path.name}: confirmed, {found.tiles} tiles and {found.leaves} leaves, "
            f"{found.measured} distances; {found.open} leaves are not claimed to be "
            "free",
            markup=False,
        )
    raise typer.Exit(TOO_CLOSE if open_still else CLEAR)


def answer_of(scene: str, proofs: list[PlanProof]) -> dict[str, Any]:
    """The answer as one JSON object."""
    return {
        "scene": scene,
        "clear": all(proof.clear for proof in proofs),
        "plans": [proof.to_dict() for proof in proofs],
    }


def interpolation_of(name: str | None) -> Interpolation | None:
    """An interpolation by its name.

    Raises:
        TrajectoryError: There is none of that name.
    """
    for known in DEGREES:
        if name == known:
            return known
    if name is not None:
        raise TrajectoryError(
            f"interpolation '{name}' is unknown; give {', '.join(DEGREES)}"
        )
    return None


def named_numbers(option: str, given: list[str] | None) -> dict[str, float]:
    """Numbers by name, "" for all.

    Raises:
        TrajectoryError: One is no number.
    """
    found = {}
    for text in given or ():
        name, _, number = text.rpartition("=")
        try:
            found[name] = float(number)
        except ValueError:
            raise TrajectoryError(
                f"{option} {text}: '{number}' is no number; give NUMBER or NAME=NUMBER"
            ) from None
    return found


def start_of(given: str | None, scene: Scene) -> Floats | None:
    """Joint positions at which the arms rest before a plan, shape (n,)."""
    if given is None:
        return None
    if given == "home":
        return scene.home
    row: Floats = load_motion(Path(given)).for_scene(scene)[-1]
    return row
