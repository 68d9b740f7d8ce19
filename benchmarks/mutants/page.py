"""The page of the mutation run, docs/mutants.md."""

from collections import Counter
from collections.abc import Mapping
from typing import Any

from mutants.results import Known
from pages import rendered


def page(known: Known, about: Mapping[str, Any], reasons: Mapping[str, str]) -> str:
    """The page.

    Args:
        known: Outcomes by identity.
        about: Machine, digest of kernels, tests.
        reasons: Why one that lives is equivalent, by identity.
    """
    ordered = sorted(
        ((key, one) for key, one in known.items() if one["outcome"] != "unfit"),
        key=lambda pair: (pair[1]["file"], pair[1]["at"], pair[0]),
    )
    fit = [one for _, one in ordered]
    return rendered(
        "mutants",
        about=about,
        reasons=reasons,
        count=len(fit),
        named=sum(one["by_hand"] for one in fit),
        outcomes=Counter(one["outcome"] for one in fit),
        how=Counter(one.get("how") for one in fit if one["outcome"] == "killed"),
        cut=sum(
            one["outcome"] == "lives" and one.get("run", 0) < one.get("tests", 0)
            for one in fit
        ),
        fit=fit,
        living=[pair for pair in ordered if pair[1]["outcome"] in ("lives", "same")],
        unreached=[pair for pair in ordered if pair[1]["outcome"] == "unreached"],
    )
