"""`armguard check`: is this scene sound? Each line PASS, WARN or FAIL."""

from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from platform import machine, python_version
from typing import Annotated

import numpy as np
import typer

from armguard.cli.claims import (
    claim_findings,
    claim_table,
    prove_claims,
    show_claims,
)
from armguard.cli.console import (
    BAD_INPUT,
    CLEAR,
    TOO_CLOSE,
    Json,
    out,
    print_json,
    say,
    say_progress,
)
from armguard.cli.findings import Finding
from armguard.cli.stopping import (
    figure_table,
    show_stops,
    stop_table,
    stopping_findings,
)
from armguard.errors import ArmguardError, HomeContactError, SelfTestError
from armguard.guard import Level, self_test
from armguard.guard.approach import has_stops
from armguard.prove import RowAudit
from armguard.respond import Guard
from armguard.robot.model import FittedLink
from armguard.scene import compile_scene, load_scene
from armguard.scene.allowed import allowed_pairs
from armguard.scene.proposal import propose_allowed
from armguard.scene.scene import Scene

# Cycles the cycle time is measured over, and the step of each joint between them.
CYCLES = 2000
JITTER = 1e-4

# A cycle that takes longer than this does not fit a 1 kHz loop [s].
PERIOD = 1e-3

STYLES = {"PASS": "blue", "WARN": "yellow", "FAIL": "bold magenta"}


def check(
    scene: Annotated[Path, typer.Argument(help="Scene file: ours, or MoveIt's.")],
    robot: Annotated[
        str | None, typer.Option(help="URDF for a MoveIt scene, or a robot's name.")
    ] = None,
    propose: Annotated[
        int,
        typer.Option(
            min=0,
            help="Sample this many configurations and propose pairs to allow; for "
            "review, nothing is applied.",
        ),
    ] = 0,
    prove: Annotated[
        bool,
        typer.Option(
            help="Prove over the whole joint box what the SRDF and the scene claim of "
            "pairs of a robot's links.",
        ),
    ] = False,
    prove_seconds: Annotated[
        float, typer.Option(min=0.0, help="Time for all proofs together [s].")
    ] = 60.0,
    json: Json = False,
) -> None:
    """Check a scene. Exit code 0 sound, 1 too close at home, 2 cannot be guarded."""
    loaded: Scene | None = None
    findings = [versions()]
    proposals: list[str] = []
    fits: list[dict[str, object]] = []
    audits: list[RowAudit] = []
    try:
        loaded = load_scene(scene, robot=robot, progress=say_progress)
    except ArmguardError as error:
        findings.append(Finding("scene", "FAIL", str(error), "mend the file"))
    else:
        fits = fit_table(loaded)
        findings += describe(loaded, fits, prove)
        findings += stopping_findings(loaded)
        findings += judge_guard(loaded)
        if prove:
            audits = prove_claims(loaded, prove_seconds)
            findings += claim_findings(audits)
        if propose:
            found = propose_allowed(compile_scene(loaded), samples=propose)
            proposals = [p.yaml for p in found]
    code = worst(findings)
    if json:
        print_json(
            {
                "scene": scene.name,
                "exit_code": code,
                "findings": [
                    {key: getattr(f, key) for key in Finding.__slots__}
                    for f in findings
                ],
                "fits": fits,
                "stopping": [] if loaded is None else stop_table(loaded),
                "figures": [] if loaded is None else figure_table(loaded),
                "proposals": proposals,
                "claims": claim_table(audits) if prove else None,
            }
        )
    else:
        show(findings, fits, loaded, proposals, propose)
        show_claims(audits)
    raise typer.Exit(code)


def versions() -> Finding:
    """Versions of what the guard stands on."""
    parts = [f"{name} {version(name)}" for name in ("armguard", "numba", "numpy")]
    where = f"Python {python_version()} on {machine()}"
    return Finding("versions", "PASS", ", ".join([*parts, where]))


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


def exact_overreach(fit: FittedLink) -> float:
    """How far the exact shapes of a link reach beyond its geometry [m]."""
    return max((placed.model_error for placed in fit.exact), default=0.0)


def exact_stage(name: str, fits: Iterable[FittedLink]) -> Finding:
    """What the second, exact stage of a robot's links is worth."""
    both = [fit for fit in fits if fit.exact]
    if not both:
        return Finding(
            "exact shapes", "PASS", f"robot '{name}': its primitives are exact"
        )
    contained = sum(fit.contained for fit in both)
    better = sum(exact_overreach(fit) < fit.overreach for fit in both)
    return Finding(
        "exact shapes",
        "PASS",
        f"robot '{name}': {len(both)} links are measured again by hulls and true "
        f"cylinders before they stop the arm; {contained} of these are proven to lie "
        f"in the link's primitives, {better} reach less far beyond the mesh than the "
        "primitives do",
    )


def describe(scene: Scene, fits: list[dict[str, object]], prove: bool) -> list[Finding]:
    """What the scene says: joints, names, geometry, fits, allowed pairs."""
    findings = []
    for name, robot in scene.robots.items():
        joints = ", ".join(robot.model.q_names)
        findings.append(
            Finding(
                "joints",
                "PASS",
                f"robot '{name}' takes {len(robot.model.q_names)} positions [rad, m] "
                f"in this order: {joints}",
            )
        )
        meshes = sum(
            1
            for link in robot.model.links.values()
            for element in link.collisions
            if hasattr(element.geometry, "path")
        )
        findings.append(
            Finding("meshes", "PASS", f"robot '{name}': {meshes} mesh files, all found")
        )
        findings.append(exact_stage(name, robot.fits.values()))
    findings += [
        Finding("notes", "WARN", note, "see docs/robots.md") for note in scene.notes
    ] or [Finding("notes", "PASS", "every visible link has collision geometry")]
    wide = [
        f for f in fits if float(str(f["overreach_mm"])) > float(str(f["target_mm"]))
    ]
    findings += [
        Finding(
            "fit",
            "WARN",
            f"{f['link']} overreaches by {f['overreach_mm']} mm, "
            f"target {f['target_mm']} mm",
            "raise max_primitives, or live with an earlier stop there",
        )
        for f in wide
    ] or [Finding("fit", "PASS", "every link is within its fit target")]
    rules = allowed_pairs(scene)
    count = {
        source: sum(rule.source == source for rule in rules)
        for source in ("rigid", "adjacent", "srdf", "scene")
    }
    claimed = count["srdf"] + count["scene"]
    findings.append(
        Finding(
            "allowed pairs",
            "WARN" if claimed and not prove else "PASS",
            f"{count['rigid']} rigid, {count['adjacent']} adjacent, "
            f"{count['srdf']} claimed by SRDF, {count['scene']} allowed by the scene",
            f"{claimed} claims are unproven, taken as claims; prove them with --prove"
            if claimed and not prove
            else "",
        )
    )
    return findings


def judge_guard(scene: Scene) -> list[Finding]:
    """What the guard says: overlap and closeness at home, index, cycle time."""
    try:
        guard = Guard(scene, progress=say, self_test=False)
    except HomeContactError as error:
        return [Finding("home", "FAIL", str(error), "see docs/concepts.md, home")]
    except ArmguardError as error:
        return [Finding("guard", "FAIL", str(error), "mend the scene")]
    home = guard.home_verdict
    findings = [
        Finding(
            "home",
            "FAIL" if home.level is Level.STOP else "PASS",
            home.why,
            "give another home, or a smaller buffer to this pair"
            if home.level is Level.STOP
            else "",
        )
    ]
    guard.index.check()
    tables = guard.tables
    findings.append(
        Finding(
            "index",
            "PASS",
            f"{len(tables.kinds)} primitives, {tables.moving_count} moving, "
            f"{tables.checkable_pairs} pairs to check; the index passes its audit",
        )
    )
    findings += self_test_findings(guard)
    findings.append(cycle_time(guard))
    return findings


def self_test_findings(guard: Guard) -> list[Finding]:
    """What the guard's test of itself came to; nothing where no stops are predicted."""
    if not has_stops(guard.tables):
        return []
    try:
        report = self_test(guard)
    except SelfTestError as error:
        return [Finding("self-test", "FAIL", str(error), "do not arm this guard")]
    skipped = "give a home with room around it, and it will be tried"
    return [
        Finding(
            "self-test",
            "PASS" if line.status == "PASS" else "WARN",
            line.sentence,
            "" if line.status == "PASS" else skipped,
        )
        for line in report.lines
    ]


def cycle_time(guard: Guard) -> Finding:
    """How long a cycle takes on this machine, all joints moving."""
    rng = np.random.default_rng(0)
    q = guard.home + rng.uniform(-JITTER, JITTER, size=(CYCLES, len(guard.home)))
    q = np.clip(q, guard.tables.lower, guard.tables.upper)
    period, still = guard.tables.period, np.zeros_like(guard.home)
    times = np.array(
        [
            guard.step(row, k * period, velocity=still).cycle_time
            for k, row in enumerate(q)
        ]
    )
    median, p99 = float(np.median(times)), float(np.percentile(times, 99))
    return Finding(
        "cycle time",
        "PASS" if p99 < PERIOD else "WARN",
        f"median {median * 1e6:.1f} µs, p99 {p99 * 1e6:.1f} µs around home",
        ""
        if p99 < PERIOD
        else "too long for 1 kHz: fewer primitives, a quieter machine",
    )


def worst(findings: list[Finding]) -> int:
    """Exit code: 2 if there can be no guard, 1 if home is too close, else 0."""
    failed = [f.topic for f in findings if f.status == "FAIL"]
    if not failed:
        return CLEAR
    return TOO_CLOSE if failed == ["home"] else BAD_INPUT


def show(
    findings: list[Finding],
    fits: list[dict[str, object]],
    scene: Scene | None,
    proposals: list[str],
    propose: int,
) -> None:
    """Print the check for people."""
    for f in findings:
        style = STYLES[f.status]
        out.print(f"[{style}]{f.status}[/{style}] {f.topic}: ", end="")
        out.print(f.sentence, markup=False)
        if f.remedy:
            out.print(f"     -> {f.remedy}", markup=False, style="dim")
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
    if scene is not None:
        show_stops(scene)
    if propose:
        out.print(
            "\npairs that may need no check, for your review; sampling proves nothing:"
        )
        for line in proposals or ["  none"]:
            out.print(f"  {line}", markup=False)
