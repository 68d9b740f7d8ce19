"""docs/accuracy.md, from the figures."""

from typing import Any

from accuracy.peer_runs import NOTABLE, VERDICTS
from accuracy.regimes import REGIMES
from accuracy.summary import FIGURES, MISSED, TARGETS
from episodes.kernels import told_of


def number(x: float) -> str:
    """A figure as it is printed."""
    return "0" if x == 0.0 else f"{x:.0e}".replace("e-0", "e-").replace("e+0", "e+")


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    """A table in Markdown."""
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]


def page(results: dict[str, Any]) -> str:
    """The whole page."""
    kinds = results["kinds"]
    total = sum(entry["pairs"] for entry in kinds.values())
    lines = [
        "# Accuracy",
        "",
        "Written by `make accuracy`: "
        f"{total:,} pairs of shapes, {len(kinds)} pairs of kinds in {len(REGIMES)} "
        "regimes, each judged by an oracle that shares no code with the kernels.",
        "",
        "Errors are relative to the *scale* of a pair: its largest size or the "
        "distance of its centres, whichever is larger.",
        "",
        "**How it is judged.** Cores apart: the witness points bound the distance from "
        "above, a direction that separates the shapes from below, both in extended "
        "precision; the figure is what the two leave open, so it is a proof. Cores "
        "overlapping: every width of A - B that is found bounds the depth from above; "
        "polytopes are searched through the facets of A - B (qhull), curved ones "
        "through 600 directions and descents from the best. Pairs with a formula: 50 "
        "digits. *short* is a depth that is too small, which is the unsafe side.",
        "",
        "A case is drawn again by its kinds, regime and number:",
        "",
        "    python benchmarks/accuracy_campaign.py --show box-hull nested 12",
        "",
        "## Against the targets",
        "",
        *targets(kinds),
        "",
        told_of(results),
        "",
        "## Every pair of kinds",
        "",
        *pair_table(kinds),
        "",
        "## Every regime",
        "",
        *regime_table(kinds),
        "",
        "## Other libraries on the same pairs",
        "",
        *peer_section(results),
        "",
    ]
    return "\n".join(lines)


def targets(kinds: dict[str, Any]) -> list[str]:
    """Worst figures of all, beside what they have to be."""
    rows = []
    for figure, meaning in FIGURES.items():
        name = max(kinds, key=lambda k: kinds[k][figure]["worst"])
        worst = kinds[name][figure]
        target = TARGETS.get(figure)
        rows.append(
            [
                figure,
                meaning,
                number(worst["worst"]),
                number(target) if target else "",
                "" if worst["number"] < 0 else case(name, worst),
            ]
        )
    tried = sum(entry["nan"][0] for entry in kinds.values())
    missed = sum(entry["nan"][1] for entry in kinds.values())
    lost = sum(entry["not_finite"] for entry in kinds.values())
    slowest = max(entry["seconds"] for entry in kinds.values())
    return [
        *table(["figure", "meaning", "worst", "target", "where"], rows),
        "",
        "Missed by single pairs:",
        "",
        *(
            f"- {figure}, {case(kind, kinds[kind][figure])}, "
            f"{kinds[kind][figure]['worst']:.2g}: {reason}."
            for (figure, kind), reason in MISSED.items()
        ),
        "",
        f"Answers that are no finite numbers: {lost}. NaN in, number out: {missed} of "
        f"{tried}. Longest call, waits of the machine included: "
        f"{slowest * 1e3:.1f} ms.",
    ]


def case(name: str, entry: dict[str, Any]) -> str:
    """How a case is called."""
    return f"{name} {entry['regime']} {entry['number']}"


def pair_table(kinds: dict[str, Any]) -> list[str]:
    """A row a pair of kinds."""
    rows = []
    for name, entry in kinds.items():
        apart, deep = entry["apart"], entry["deep"]
        exact = entry["formula"]
        rows.append(
            [
                name,
                "formula" if entry["closed_form"] else "solver",
                f"{entry['pairs']:,}",
                number(apart["worst"]),
                apart["regime"],
                number(deep["worst"]) if deep["pairs"] else "",
                deep["regime"],
                number(entry["short"]["worst"]) if deep["pairs"] else "",
                number(exact["worst"]) if exact["pairs"] else "",
                number(entry["witness"]["worst"]),
                number(entry["normal"]["worst"]),
            ]
        )
    head = ["pair", "by", "pairs", "apart", "worst in", "deep", "worst in", "short"]
    return table([*head, "50 digits", "witness", "normal"], rows)


def regime_table(kinds: dict[str, Any]) -> list[str]:
    """Worst figures of a regime over all kinds."""
    rows = []
    for regime, draw in REGIMES.items():
        row = [regime, (draw.__doc__ or "").splitlines()[0].rstrip(".")]
        for figure in ("apart", "deep", "short", "witness", "normal"):
            worst = [entry[figure]["by"].get(regime, 0.0) for entry in kinds.values()]
            row.append(number(max(worst)))
        rows.append(row)
    return table(["regime", "", "apart", "deep", "short", "witness", "normal"], rows)


def peer_section(results: dict[str, Any]) -> list[str]:
    """Who else is wrong, where, how often."""
    count, peers = results["peers"]["count"], results["peers"]["found"]
    if not peers:
        return ["Not asked in this run."]
    lines = [
        f"The first {count} pairs of each regime and pair of kinds, "
        "tolerances of 1e-12 (python-fcl has none to set). An answer is wrong where it "
        f"is more than {number(NOTABLE)} × scale outside the oracle's bounds.",
        "",
    ]
    rows = []
    for word, meaning in VERDICTS.items():
        row = [word, meaning]
        for peer in peers.values():
            row.append(
                str(
                    sum(e["wrong"].get(word, {}).get("count", 0) for e in peer.values())
                )
            )
        rows.append(row)
    asked = ["asked", ""]
    asked += [f"{sum(e['asked'] for e in peer.values()):,}" for peer in peers.values()]
    lines += table(
        ["", "", *(f"{p} {results['peers']['versions'][p]}" for p in peers)],
        [asked, *rows],
    )
    for name, peer in peers.items():
        lines += ["", f"### {name}", "", *wrong_table(peer), ""]
        none = [kind for kind, entry in peer.items() if not entry["asked"]]
        if none:
            lines += [f"Not supported: {', '.join(none)}."]
    return lines


def wrong_table(peer: dict[str, Any]) -> list[str]:
    """One row a pair of kinds that a peer got wrong, with its worst case."""
    rows = []
    for kind, entry in peer.items():
        for word, found in entry["wrong"].items():
            answer = found.get("answer")
            rows.append(
                [
                    kind,
                    word,
                    f"{found['count']} of {entry['asked']}",
                    number(found["error"]) if answer is not None else "",
                    f"{found['regime']} {found['number']}",
                    "" if answer is None else f"{answer:.6g}",
                    f"{found['truth']:.6g}",
                    f"{found['ours']:.6g}",
                ]
            )
    if not rows:
        return ["Nothing wrong."]
    head = ["pair", "what", "count", "worst / scale", "example", "it says", "truth"]
    return table([*head, "armguard"], rows)
