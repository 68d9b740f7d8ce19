"""Coverage in `armguard check`: parts of links that no sensor sees."""

from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.cli.finding import Finding
from armguard.scene.scene import Scene
from armguard.sense.coverage import LEAST, Coverage, Patch, coverage

# A body of more than this is of any size [m].
ANY_SIZE = 1.0


def scene_coverage(scene: Scene) -> Coverage | None:
    """The coverage of a scene's links at home.

    Returns:
        None if it has no sensed space, or SciPy is missing.
    """
    if scene.sensing is None or not scene.sensors or find_spec("scipy") is None:
        return None
    return coverage(scene)


def coverage_findings(scene: Scene, found: Coverage | None) -> Iterator[Finding]:
    """The parts of each link that no sensor sees, and what can hide there."""
    if found is None:
        if scene.sensing is not None and scene.sensors:
            yield Finding(
                "coverage",
                "WARN",
                "SciPy is missing, so patches that no sensor sees are not named",
                "pip install 'armguard[meshes]'",
            )
        return
    by_link = {
        link: [one for one in found.patches if one.link == link] for link in found.seen
    }
    blind, before = sum(map(bool, by_link.values())), round(found.standoff * 1e3)
    yield Finding(
        "coverage",
        "WARN" if blind else "PASS",
        f"{blind or 'none'} of {len(by_link)} links have patches of more than "
        f"{LEAST * 1e3:.0f} mm that no sensor sees, {before} mm before their surface, "
        "with all arms at home",
        "add sensors that look there; `--json` has the place of each patch"
        if blind
        else "",
        keys=("sensors",),
    )
    for link, patches in by_link.items():
        if not patches:
            yield Finding("coverage", "PASS", f"{link}: no patch is unseen")
            continue
        first, rest = patches[0], len(patches) - 1
        more = f" ({rest} smaller one{'s' * (rest > 1)} beside)" if rest else ""
        body = max(one.body for one in patches)
        yield Finding(
            "coverage",
            "WARN",
            f"{link}: {first.size * 1e3:.0f} mm on its {side(first.facing)} side seen "
            f"by no sensor{more}; a body of {size(body)} can hide",
        )


def coverage_table(found: Coverage | None) -> list[dict[str, Any]]:
    """All patches, the largest first."""
    return [row(one) for one in found.patches] if found is not None else []


def row(patch: Patch) -> dict[str, Any]:
    """A patch in plain numbers."""
    return {
        "link": patch.link,
        "size_mm": round(patch.size * 1e3, 1),
        "hides_mm": round(patch.body * 1e3, 1) if patch.body < ANY_SIZE else None,
        "centre": [round(float(x), 4) for x in patch.centre],
        "facing": [round(float(x), 3) for x in patch.facing],
    }


def size(body: float) -> str:
    """The size of a body in words."""
    return f"{body * 1e3:.0f} mm" if body < ANY_SIZE else "any size"


def side(facing: NDArray[np.float64]) -> str:
    """The axis of the link that a normal follows most: "+x"."""
    axis = int(np.argmax(np.abs(facing)))
    return f"{'+' if facing[axis] >= 0.0 else '-'}{'xyz'[axis]}"
