"""The page of the mutation run, docs/mutants.md."""

from collections import Counter
from collections.abc import Mapping
from typing import Any

from mutants.results import Known

HEAD = """# Mutation run: do the tests notice when deciding code changes?

`make mutants` compiles a copy of the package in which {count} single changes of the
kernels of `motion/`, `guard/`, `respond/` and `index/` are present at once, each behind
a switch in memory, and runs the tests against one after another. A mutant is *killed*
if a test fails, hangs or crashes. {named} are written by hand
(`benchmarks/mutants/named.yaml`), the others are drawn: a comparison turned round or
decided beforehand, a term, a factor or a limit left out, a bound taken 3 % smaller, a
number not written.

A dry run with every mutant off notes which tests pass each place and in which of them
the mutated value differs from the original. Only those are run against it: in any other
test the mutant is the original. A mutant whose value differs in no test counts as
living.

How it works: `benchmarks/mutants/build.py` (choice and copy), `switch.py` (the switch),
`trial.py` (dry run and forks), `results.py` (what is due). An outcome is kept as long
as the kernel and the tests it rests on are as they were; `make mutants ARGS=--due`
lists the others. Tests: {tests}.
"""


def page(known: Known, about: Mapping[str, Any], reasons: Mapping[str, str]) -> str:
    """The page.

    Args:
        known: Outcomes by identity.
        about: Machine, digest of kernels, tests.
        reasons: Why one that lives is equivalent, by identity.
    """
    fit = {key: one for key, one in known.items() if one["outcome"] != "unfit"}
    named = sum(one["by_hand"] for one in fit.values())
    head = HEAD.format(count=len(fit), named=named, tests=", ".join(about["tests"]))
    return "\n".join(
        [
            head,
            *score_rows(fit, about),
            *file_rows(fit),
            *living_rows(fit, reasons),
            *unreached_rows(fit),
        ]
    )


def score_rows(fit: Known, about: Mapping[str, Any]) -> list[str]:
    """The score in all."""
    counts = Counter(one["outcome"] for one in fit.values())
    how = Counter(one.get("how") for one in fit.values() if one["outcome"] == "killed")
    killed = counts["killed"]
    cut = sum(
        one["outcome"] == "lives" and one.get("run", 0) < one.get("tests", 0)
        for one in fit.values()
    )
    return [
        "## Score",
        "",
        f"**{killed} of {len(fit)} mutants killed, {share(killed, len(fit))}**: "
        f"{how['fails']} by a test that fails, {how['crashes']} by a crash, "
        f"{how['hangs']} by a test that hangs.",
        "",
        "| outcome | mutants |",
        "| --- | --- |",
        f"| killed | {killed} |",
        f"| lives though its value differs in a test | {counts['lives']} |",
        f"| - of these not yet run against all of these tests | {cut} |",
        f"| lives, its value differs in no test | {counts['same']} |",
        f"| no test passes its place | {counts['unreached']} |",
        "",
        f"Kernels `{about['kernels']}`; {about['machine']}.",
        "",
    ]


def file_rows(fit: Known) -> list[str]:
    """The score of each file."""
    rows = [
        "## By file",
        "",
        "| file | killed | of | score |",
        "| --- | --- | --- | --- |",
    ]
    total = Counter(one["file"] for one in fit.values())
    killed = Counter(one["file"] for one in fit.values() if one["outcome"] == "killed")
    for file in sorted(total):
        score = share(killed[file], total[file])
        rows.append(f"| {file} | {killed[file]} | {total[file]} | {score} |")
    return [*rows, ""]


def living_rows(fit: Known, reasons: Mapping[str, str]) -> list[str]:
    """Those that live, with the reason where there is one."""
    rows = [
        "## Those that live",
        "",
        "| mutant | where | change | tests | why nothing is lost |",
        "| --- | --- | --- | --- | --- |",
    ]
    for key, one in in_order(fit, ("lives", "same")):
        run, tests = one.get("run", 0), one.get("tests", 0)
        ran = f"{run} of {tests}" if run < tests else f"{tests}"
        why = reasons.get(key, "**a test is missing**")
        rows.append(f"| {key} | {where(one)} | {change(one)} | {ran} | {why} |")
    return [*rows, ""]


def unreached_rows(fit: Known) -> list[str]:
    """Those whose place no test passes."""
    rows = ["## Not reached by any of these tests", ""]
    rows += [
        f"- {key} {where(one)}: {change(one)}"
        for key, one in in_order(fit, ("unreached",))
    ]
    return [*rows, ""]


def in_order(fit: Known, outcomes: tuple[str, ...]) -> list[tuple[str, dict[str, Any]]]:
    """Mutants of some outcomes, by file and line."""
    found = [(key, one) for key, one in fit.items() if one["outcome"] in outcomes]
    return sorted(found, key=lambda pair: (pair[1]["file"], pair[1]["at"], pair[0]))


def where(one: Mapping[str, Any]) -> str:
    """The place of a mutant; no line number, which any edit would change."""
    return f"{one['file']}, `{one['function']}`"


def change(one: Mapping[str, Any]) -> str:
    """What is changed."""
    text = f"`{one['before']}` → `{one['after']}`".replace("|", "\\|")
    return f"{one['change']}: {text}" if one["by_hand"] else text


def share(part: int, whole: int) -> str:
    """A share in per cent."""
    return f"{100.0 * part / whole:.1f} %" if whole else "-"
