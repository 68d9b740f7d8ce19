"""`armguard chaos`: every fault injected into a running guard."""

import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import typer
from typer import Option

from armguard.chaos.fault import Fault, Outcome
from armguard.chaos.play import play
from armguard.chaos.playground import Playground
from armguard.chaos.table import FAULTS
from armguard.cli.console import (
    CLEAR,
    Json,
    SceneName,
    compile_kernels,
    out,
    plain_table,
    print_json,
    say,
)
from armguard.errors import SceneError, did_you_mean
from armguard.service.server.scenes import open_scene

STYLES = {"PASS": "blue", "FAIL": "bold white on magenta", "SKIP": "dim"}

# Exit code if an observation is not as declared.
NOT_AS_DECLARED = 1


def chaos(
    scene: SceneName = "bay",
    only: Annotated[
        list[str] | None,
        Option(help="Inject only faults whose names contain this; repeatable."),
    ] = None,
    list_faults: Annotated[
        bool, Option("--list", help="List the faults and inject none.")
    ] = False,
    rate: Annotated[float, typer.Option(help="Rate of the cycles [Hz].")] = 250.0,
    late: Annotated[
        float,
        typer.Option(help="Permitted delay of a cycle beyond its period [s]."),
    ] = 0.012,
    slack: Annotated[
        float,
        Option(
            help="Delay that this computer may add to every declared time because "
            "of its other work [s]."
        ),
    ] = 0.15,
    json: Json = False,
) -> None:
    """Inject faults into a simulated guard, and check the answers.

    The effect of every known fault is compared with the declared one.

    No real robot takes part. Exit code 0 if every fault had its declared effect, 1 if
    one had not.
    """
    faults = chosen(only)
    if list_faults:
        print_faults(faults, json)
        return
    say(f"starting a guard, simulated arms and an operator in '{scene}' ...")
    compile_kernels()
    outcomes = []
    opened, _ = open_scene(scene, period=1.0 / rate, late=late)
    with (
        TemporaryDirectory() as folder,
        Playground(
            scene, opened, Path(folder), rate=rate, late=late, slack=slack
        ) as ground,
    ):
        ground.start()
        began = time.monotonic()
        for k, fault in enumerate(faults):
            left = ""
            if k:
                seconds = (time.monotonic() - began) / k * (len(faults) - k)
                left = f", about {seconds:.0f} s left"
            say(f"{k + 1} of {len(faults)}{left}: {fault.group}, {fault.name}")
            outcomes.append(play(ground, fault))
    code = CLEAR if all(each.passed for each in outcomes) else NOT_AS_DECLARED
    if json:
        rows = list(map(row_of, outcomes))
        print_json({"scene": scene, "faults": rows, "exit_code": code})
    else:
        print_outcomes(outcomes)
    raise typer.Exit(code)


def chosen(only: list[str] | None) -> list[Fault]:
    """The faults to play.

    Raises:
        SceneError: A word is in no name.
    """
    if not only:
        return list(FAULTS)
    faults = {f"{fault.group}, {fault.name}".lower(): fault for fault in FAULTS}
    for word in only:
        if not any(word.lower() in name for name in faults):
            near = did_you_mean(word, [fault.name for fault in FAULTS])
            raise SceneError(
                f"no fault's name contains '{word}'; {near}; `armguard chaos --list` "
                "prints all names"
            )
    return [
        f for name, f in faults.items() if any(word.lower() in name for word in only)
    ]


def declared(fault: Fault) -> str:
    """What is declared, in words."""
    words = fault.effect.value
    if fault.reasons:
        words += ": " + " or ".join(fault.reasons)
    if fault.counts:
        words += "; counted"
    return words


def status(outcome: Outcome) -> str:
    """PASS, FAIL or SKIP."""
    return "SKIP" if outcome.skipped else "PASS" if outcome.passed else "FAIL"


def row_of(outcome: Outcome) -> dict[str, Any]:
    """An outcome as one JSON object."""
    fault = outcome.fault
    return {
        "group": fault.group,
        "fault": fault.name,
        "declared": declared(fault),
        "observed": outcome.observed,
        "status": status(outcome),
        "skipped": outcome.skipped,
        "tries": outcome.tries,
        "waited": outcome.waited,
        "told": outcome.reported,
        "rested": outcome.rested,
    }


def print_faults(faults: list[Fault], json: bool) -> None:
    """Print the names of faults, and their declared effects."""
    if json:
        print_json(
            {
                "faults": [
                    {"group": f.group, "fault": f.name, "declared": declared(f)}
                    for f in faults
                ]
            }
        )
        return
    table = plain_table("group", "fault", "declared")
    for fault in faults:
        table.add_row(fault.group, fault.name, declared(fault))
    out.print(table)


def print_outcomes(outcomes: list[Outcome]) -> None:
    """Print the table and the count of each status."""
    table = plain_table("", "fault", "declared", "observed")
    group = ""
    for outcome in outcomes:
        fault = outcome.fault
        if fault.group != group:
            group = fault.group
            table.add_row("", f"[bold]{group}[/bold]", "", "")
        word = status(outcome)
        seen = outcome.skipped or outcome.observed
        if outcome.tries > 1:
            seen += f" (try {outcome.tries}: this computer was late in the others)"
        table.add_row(f"[{STYLES[word]}]{word}[/]", fault.name, declared(fault), seen)
    out.print(table)
    count = Counter(map(status, outcomes))
    skipped = f", {count['SKIP']} not played" if count["SKIP"] else ""
    total = f"{count['PASS']} of {len(outcomes)} as declared, {count['FAIL']} not"
    out.print(total + skipped)
