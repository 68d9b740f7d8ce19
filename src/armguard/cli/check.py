"""`armguard check`: is this scene sound? Each line PASS, WARN or FAIL."""

from dataclasses import asdict
from typing import Annotated

import typer
from typer import Option

from armguard.cli.claims import claim_findings, claim_table, prove_claims, show_claims
from armguard.cli.console import (
    BAD_INPUT,
    CLEAR,
    TOO_CLOSE,
    Json,
    RobotOption,
    SceneFile,
    out,
    print_json,
    say_progress,
)
from armguard.cli.findings import (
    Finding,
    exact_overreach,
    guard_findings,
    scene_findings,
    versions,
)
from armguard.cli.stopping import (
    figure_table,
    show_stops,
    stop_table,
    stopping_findings,
)
from armguard.errors import ArmguardError
from armguard.prove import RowAudit
from armguard.scene import compile_scene, load_scene
from armguard.scene.proposal import propose_allowed
from armguard.scene.scene import Scene

STYLES = {"PASS": "blue", "WARN": "yellow", "FAIL": "bold magenta"}


def check(
    scene: SceneFile,
    robot: RobotOption = None,
    propose: Annotated[
        int,
        Option(
            min=0,
            help="Sample this many configurations and propose pairs to allow; for "
            "review, nothing is applied.",
        ),
    ] = 0,
    prove: Annotated[
        bool,
        Option(
            help="Prove over the whole joint box what the SRDF and the scene claim of "
            "pairs of a robot's links."
        ),
    ] = False,
    prove_seconds: Annotated[
        float, Option(min=0.0, help="Time for all proofs together [s].")
    ] = 60.0,
    json: Json = False,
) -> None:
    """Check a scene. Exit code 0 sound, 1 too close at home, 2 cannot be guarded."""
    loaded: Scene | None = None
    findings = [versions()]
    proposals: list[str] = []
    audits: list[RowAudit] = []
    try:
        loaded = load_scene(scene, robot=robot, progress=say_progress)
    except ArmguardError as error:
        findings.append(Finding("scene", "FAIL", str(error), "fix the file"))
    else:
        findings += scene_findings(loaded, prove)
        findings += stopping_findings(loaded)
        findings += guard_findings(loaded)
        if prove:
            audits = prove_claims(loaded, prove_seconds)
            findings += claim_findings(audits)
        if propose:
            found = propose_allowed(compile_scene(loaded), samples=propose)
            proposals = [pair.yaml for pair in found]
    code = worst(findings)
    if json:
        answer = {
            "scene": scene.name,
            "exit_code": code,
            "findings": [asdict(finding) for finding in findings],
            **tables_of(loaded),
            "proposals": proposals,
            "claims": claim_table(audits) if prove else None,
        }
        print_json(answer)
    else:
        show(findings, loaded, proposals if propose else None)
        show_claims(audits)
    raise typer.Exit(code)


def worst(findings: list[Finding]) -> int:
    """Exit code: 2 if there can be no guard, 1 if home is too close, else 0."""
    failed = [finding.topic for finding in findings if finding.status == "FAIL"]
    if not failed:
        return CLEAR
    return TOO_CLOSE if failed == ["home"] else BAD_INPUT


def tables_of(scene: Scene | None) -> dict[str, list[dict[str, object]]]:
    """Fits, stops and figures of a scene; empty if it could not be loaded."""
    tables = {"fits": fit_table, "stopping": stop_table, "figures": figure_table}
    return {name: table(scene) if scene else [] for name, table in tables.items()}


def fit_table(scene: Scene) -> list[dict[str, object]]:
    """Fit quality of each link."""
    return [
        {
            "link": f"{name}/{link}",
            "primitives": len(fit.shapes),
            "kinds": "".join(s.shape.kind.name[0] for s in fit.shapes),
            "overreach_mm": round(fit.overreach * 1e3, 1),
            "target_mm": round(robot.fit_target * 1e3, 1),
            "source": fit.source,
            "exact_shapes": len(fit.exact),
            "exact_overreach_mm": round(exact_overreach(fit) * 1e3, 1),
            "exact_contained": fit.contained,
        }
        for name, robot in scene.robots.items()
        for link, fit in robot.fits.items()
    ]


def show(
    findings: list[Finding], scene: Scene | None, proposals: list[str] | None
) -> None:
    """Print the check for people."""
    for finding in findings:
        style = STYLES[finding.status]
        out.print(f"[{style}]{finding.status}[/{style}] {finding.topic}: ", end="")
        out.print(finding.sentence, markup=False)
        if finding.remedy:
            out.print(f"     -> {finding.remedy}", markup=False, style="dim")
    if scene is not None:
        show_fits(fit_table(scene))
        show_stops(scene)
    if proposals is not None:
        out.print(
            "\npairs that may need no check, for your review; sampling proves nothing:"
        )
        for line in proposals or ["  none"]:
            out.print(f"  {line}", markup=False)


def show_fits(fits: list[dict[str, object]]) -> None:
    """Print the fit quality of links for people."""
    if fits:
        out.print(
            "\nlink, primitives (Sphere, Capsule, Box), overreach of these and of the "
            "exact shapes:"
        )
    for fit in fits:
        exact = f"{fit['exact_overreach_mm']} mm" if fit["exact_shapes"] else "-"
        out.print(
            f"  {fit['link']:36} {fit['kinds']:10} {fit['overreach_mm']:6} mm  "
            f"{exact:>9}  {fit['source']}",
            markup=False,
        )
