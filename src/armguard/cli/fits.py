"""Fits in `armguard check`: links that are grown far, and what closer fits bring."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from armguard.cli.console import loading_bar, say
from armguard.cli.cycles import cycle_times, step
from armguard.cli.finding import Finding
from armguard.errors import HomeContactError
from armguard.geometry.shapes import shape_row
from armguard.respond import Guard
from armguard.robot.model import FittedLink
from armguard.scene.blocks import extent
from armguard.scene.scene import Scene, SceneRobot

# A link may be grown by this share of its thickness [-].
OVERREACH_SHARE = 0.5

# Most primitives a scene file may give a link, and the least target that is proposed:
# the overreach is measured to a millimetre [m].
MOST_PRIMITIVES = 64
LEAST_TARGET = 0.002

# A closer fit is worth its primitives if it leaves less than this of an overreach [-].
WORTH = 0.95

ACCEPT = "accept that the arm stops that much earlier there"

# Settings of a robot's fits, and closer fits by robot and link.
Settings = dict[str, Any]
Fits = Mapping[str, Mapping[str, FittedLink]]


def fit_findings(scene: Scene, file: str, closer: bool) -> Iterator[Finding]:
    """Links that are grown beyond their target, or by a large share of their thickness.

    Args:
        scene: The scene; unchanged afterwards.
        file: Name of its file.
        closer: Whether closer fits are made and measured.
    """
    wide = {name: wide_links(robot) for name, robot in scene.robots.items()}
    wide = {name: fits for name, fits in wide.items() if fits}
    if not wide:
        yield Finding("fit", "PASS", "every link is within its fit target")
        return
    settings = {name: closer_settings(scene.robots[name], wide[name]) for name in wide}
    found, cost = closer_fits(scene, settings) if closer else ({}, "")
    for name, fits in wide.items():
        keys, target = ("robots", name), scene.robots[name].fit_target
        paste = "\n".join(f"{key}: {it}" for key, it in settings[name].items())
        most = settings[name]["max_primitives"]
        limit = f"target {target * 1e3:.1f} mm"
        if not closer:
            names = ", ".join(map(overreach_in_words, fits))
            remedy = f"{ACCEPT}, or fit closer; `armguard check {file} --closer`"
            remedy += " measures the effect"
            yield Finding("fit", "WARN", f"{names}; {limit}", remedy, keys, paste)
            continue
        for fit in fits:
            sentence, better = (
                f"{overreach_in_words(fit)}; {limit}",
                found[name][fit.link],
            )
            reach = f"bring {better.overreach * 1e3:.1f} mm"
            if better.overreach < WORTH * fit.overreach:
                count = f"{len(better.shapes)} primitives instead of {len(fit.shapes)}"
                remedy = f"{ACCEPT}, or fit closer: {count} {reach}{cost}"
                yield Finding("fit", "WARN", sentence, remedy, keys, paste)
            else:
                remedy = f"{ACCEPT}: up to {most} primitives {reach}"
                yield Finding("fit", "WARN", sentence, remedy, keys)


def overreach_in_words(fit: FittedLink) -> str:
    """A link that is grown, by how much, and how thick it is."""
    by, thick = fit.overreach * 1e3, thickness(fit) * 1e3
    return f"{fit.link} overreaches by {by:.1f} mm ({thick:.0f} mm thick)"


def wide_links(robot: SceneRobot) -> list[FittedLink]:
    """Links that `fit_findings` names."""
    return [
        fit
        for fit in robot.fits.values()
        if round(fit.overreach, 4) > round(robot.fit_target, 4)
        or fit.overreach > OVERREACH_SHARE * thickness(fit)
    ]


def closer_settings(robot: SceneRobot, wide: Sequence[FittedLink]) -> Settings:
    """Settings that may bring links within their target and share."""
    settings: Settings = {
        "max_primitives": min(2 * robot.max_primitives, MOST_PRIMITIVES)
    }
    share = max(OVERREACH_SHARE * min(map(thickness, wide)), LEAST_TARGET)
    if share < robot.fit_target:
        settings["fit_target"] = float(f"{share:.2g}")
    return settings


def closer_fits(scene: Scene, settings: Mapping[str, Settings]) -> tuple[Fits, str]:
    """Fits of robots with other settings, and what a cycle takes with them.

    Args:
        scene: The scene; unchanged afterwards.
        settings: Settings of their fits by robot.
    """
    own = {
        name: {key: getattr(scene.robots[name], key) for key in changed}
        for name, changed in settings.items()
    }
    before = cycle_time(scene)
    try:
        with loading_bar() as progress:
            for name, changed in settings.items():
                scene.set_fit(name, **changed, progress=progress)
        after = cycle_time(scene)
        found = {name: scene.robots[name].fits for name in settings}
    finally:
        for name, changed in own.items():
            scene.set_fit(name, **changed)
    if before is None or after is None:
        return found, ""
    return found, (
        f"; a cycle at home takes {after * 1e6:.1f} instead of {before * 1e6:.1f} µs "
        "if all links with a warning are fitted closer"
    )


def cycle_time(scene: Scene) -> float | None:
    """Median time of a cycle around home [s]; None if links touch there."""
    try:
        guard = Guard(scene, progress=say, self_test=False)
    except HomeContactError:
        return None
    times = cycle_times(guard, lambda q, stamp: step(guard, q, stamp))
    return float(np.median(times))


def thickness(fit: FittedLink) -> float:
    """Smallest edge of the box around a link's geometry [m]."""
    shapes = fit.exact or fit.shapes
    rows = np.array([shape_row(s.shape, s.pose.matrix()) for s in shapes])
    box = np.zeros(6)
    extent(np.array([int(s.shape.kind) for s in shapes], dtype=np.int32), rows, box)
    return float((box[3:] - box[:3]).min())
