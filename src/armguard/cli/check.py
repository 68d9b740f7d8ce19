"""`armguard check`: what keeps a scene from being guarded, and a verdict."""

from collections.abc import Iterator
from pathlib import Path
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
    loading_bar,
    out,
    print_json,
)
from armguard.cli.coverage import coverage_findings, coverage_table, scene_coverage
from armguard.cli.finding import Finding, Merged, merged, subject
from armguard.cli.findings import (
    exact_overreach,
    file_findings,
    guard_findings,
    scene_findings,
    versions,
)
from armguard.cli.fits import fit_findings
from armguard.cli.plausibility import plausibility_findings
from armguard.cli.reflex import prove_reflex, reflex_findings, zone_table
from armguard.cli.sensors import sensor_findings
from armguard.cli.stopping import (
    figure_table,
    show_stops,
    stop_table,
    stopping_findings,
)
from armguard.errors import ArmguardError
from armguard.prove import RowAudit, ZoneProofs
from armguard.scene import compile_scene, load_scene
from armguard.scene.proposal import propose_allowed
from armguard.scene.scene import Scene
from armguard.scene.yaml_source import YamlSource, dotted
from armguard.sense.coverage import Coverage

# Styles of findings, in the order in which they are printed.
STYLES = {"PASS": "blue", "WARN": "yellow", "FAIL": "bold magenta"}

# Topics whose line is printed though it is a PASS.
ALWAYS = ("claims", "coverage", "reflex", "sensors")


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
            help="Prove, for all joint positions, what SRDF and scene claim about "
            "pairs of a robot's links."
        ),
    ] = False,
    reflex: Annotated[
        bool,
        Option(
            help="Prove which zones of its sensors no posture of the robot trips, and "
            "write the file of the reflex."
        ),
    ] = False,
    prove_seconds: Annotated[
        float, Option(min=0.0, help="Time for all proofs together [s].")
    ] = 60.0,
    closer: Annotated[
        bool,
        Option(
            help="Fit links with more primitives where they reach far beyond their "
            "meshes, and measure what that brings and what a cycle then takes."
        ),
    ] = False,
    verbose: Annotated[
        bool,
        Option("--verbose", "-v", help="Print all lines and tables, PASS included."),
    ] = False,
    json: Json = False,
) -> None:
    """Check a scene. Exit code 0 sound, 1 too close at home, 2 cannot be guarded."""
    loaded: Scene | None = None
    findings, proposals, audits = [versions()], list[str](), list[RowAudit]()
    zones: list[ZoneProofs] | None = None
    seen: Coverage | None = None
    try:
        with loading_bar() as progress:
            loaded = load_scene(scene, robot=robot, progress=progress)
    except ArmguardError as error:
        findings += file_findings(error, scene)
    else:
        findings += own_findings(loaded, scene.name, prove, closer)
        if prove:
            audits = prove_claims(loaded, prove_seconds)
            findings += claim_findings(audits)
        if reflex:
            zones = prove_reflex(loaded, prove_seconds)
        findings += reflex_findings(loaded, scene, zones)
        findings += sensor_findings(loaded)
        seen = scene_coverage(loaded)
        findings += coverage_findings(loaded, seen)
        if propose:
            proposals = proposed_pairs(loaded, propose)
    if json:
        print_json(
            {
                "scene": scene.name,
                "exit_code": worst(findings),
                "findings": [finding.row for finding in findings],
                **tables_of(loaded),
                "proposals": proposals,
                "claims": claim_table(audits) if prove else None,
                "zones": zone_table(zones) if zones is not None else None,
                "coverage": coverage_table(seen),
            }
        )
    else:
        if verbose:
            show_tables(loaded, audits)
        if propose:
            show_proposals(proposals)
        show(findings, scene, verbose)
    raise typer.Exit(worst(findings))


def proposed_pairs(scene: Scene, samples: int) -> list[str]:
    """Lines of YAML that allow the pairs which touch in most of these samples."""
    found = propose_allowed(compile_scene(scene), samples=samples)
    return [pair.yaml for pair in found]


def own_findings(
    scene: Scene, name: str, proven: bool, closer: bool
) -> Iterator[Finding]:
    """Findings of a scene that could be read.

    Args:
        scene: The scene.
        name: Name of its file.
        proven: Whether claims about pairs of links are proven as well.
        closer: Whether closer fits are measured.
    """
    yield loop_finding(scene)
    yield from scene_findings(scene, name, proven)
    yield from fit_findings(scene, name, closer)
    yield from stopping_findings(scene)
    yield from plausibility_findings(scene)
    yield from guard_findings(scene, name)


def show_tables(scene: Scene | None, audits: list[RowAudit]) -> None:
    """Print fits and stops of a scene that could be read, and audited claims."""
    if scene is not None:
        show_fits(fit_table(scene))
        show_stops(scene)
    show_claims(audits)


def loop_finding(scene: Scene) -> Finding:
    """What the loop of the user must do."""
    robots = ", ".join(f"'{name}'" for name in scene.robots)
    return Finding(
        "loop",
        "PASS",
        f"robots {robots}, {len(scene.q_names)} joints; call the guard every "
        f"{scene.period * 1e3:g} ms ({1.0 / scene.period:g} Hz), at most "
        f"{scene.late * 1e3:g} ms late",
        "another rate: `cycle: {period: SECONDS}`",
    )


def worst(findings: list[Finding]) -> int:
    """Exit code: 2 if there can be no guard, 1 if home is too close, else 0."""
    failed = {finding.topic for finding in findings if finding.status == "FAIL"}
    if failed - {"home"}:
        return BAD_INPUT
    blocked = any(finding.blocks for finding in findings)
    return TOO_CLOSE if failed or blocked else CLEAR


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


def show(findings: list[Finding], file: Path, verbose: bool) -> None:
    """Print findings for people: failures last, then the verdict."""
    lines = merged(findings)
    for status in STYLES:
        for finding, keys in lines:
            shown = verbose or status != "PASS" or finding.topic in (*ALWAYS, "loop")
            if finding.status == status and shown:
                show_finding(finding, keys, file)
    out.print(verdict(lines), style="bold", soft_wrap=True)


def show_finding(finding: Finding, keys: list[tuple[str, ...]], file: Path) -> None:
    """Print a finding, with its remedy and the place of that."""
    style = STYLES[finding.status]
    out.print(f"[{style}]{finding.status}[/{style}] {finding.topic}: ", end="")
    out.print(subject(keys) + finding.sentence, markup=False, soft_wrap=True)
    if not finding.remedy:
        return
    remedy = f"     -> {finding.remedy}"
    places = [place for place in map(dotted, keys) if place]
    if places and finding.paste:
        remedy += f"; write under {', '.join(places)} ({lines_of(keys, file)})"
    elif finding.paste:
        remedy += f"; write in {file.name}"
    elif places:
        remedy += f" ({lines_of(keys, file)})"
    out.print(remedy + (":" if finding.paste else ""), markup=False, soft_wrap=True)
    for line in finding.paste.splitlines():
        out.print(f"          {line}", markup=False, soft_wrap=True)


def lines_of(keys: list[tuple[str, ...]], file: Path) -> str:
    """Lines of a scene file in which these keys are."""
    source = YamlSource(file)
    numbers = sorted({source.line(key) for key in keys})
    many = "lines" if len(numbers) > 1 else "line"
    return f"{many} {', '.join(map(str, numbers))} of {file.name}"


def verdict(lines: list[Merged]) -> str:
    """The last line: READY, or why not."""
    failures = sum(finding.status == "FAIL" for finding, _ in lines)
    warnings = sum(finding.status == "WARN" for finding, _ in lines)
    blocked = any(finding.blocks for finding, _ in lines)
    parts = [counted(failures, "failure")] if failures else []
    parts += [counted(warnings, "warning")] if warnings else []
    parts += ["pairs of links to settle"] if blocked else []
    word = "NOT READY" if failures or blocked else "READY"
    return ": ".join(filter(None, (word, ", ".join(parts))))


def counted(number: int, word: str) -> str:
    """A count with its word: "1 failure", "4 warnings"."""
    return f"{number} {word}{'' if number == 1 else 's'}"


def show_proposals(proposals: list[str]) -> None:
    """Print pairs that may need no check."""
    out.print("pairs that may need no check, for your review; sampling proves nothing:")
    for line in proposals or ["none"]:
        out.print(f"  {line}", markup=False, soft_wrap=True)
    out.print()


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
