"""Stopping in `armguard check`: how far links go on, and the source of each figure."""

import re
from dataclasses import fields

from armguard.cli.console import out
from armguard.cli.finding import Finding, in_yaml
from armguard.robot.stopping import ASSUMPTION, StoppingFigures, stop_distances
from armguard.scene.robots import stopping_line
from armguard.scene.scene import Scene, SceneRobot
from armguard.scene.schema import meanings

# Fields of `StoppingFigures` that are no figure, but belong to them.
BESIDE = ("tables", "sources", "joints")

# A line that declares how a robot stops; the number is an example.
STOPPING = "stopping: {deceleration: 2.5}"

# The end of a meaning: "... [rad or m]".
UNIT = re.compile(r"\[([^]]+)\]\.?$")


def stop_table(scene: Scene) -> list[dict[str, object]]:
    """Worst-case stop of each link of each robot that has figures, from each speed."""
    return [
        {
            "link": f"{name}/{stop.link}",
            "speed_percent": round(100.0 * stop.share),
            "distance_mm": round(stop.distance * 1e3, 1),
            "reaction_mm": round(stop.reaction * 1e3, 1),
            "braking_mm": round(stop.braking * 1e3, 1),
            "settle_mm": round(stop.settle * 1e3, 1),
            "time_ms": round(stop.time * 1e3, 1),
        }
        for name, robot in scene.robots.items()
        if robot.stopping is not None
        for stop in stop_distances(
            robot.model,
            robot.fits,
            robot.stopping,
            period=scene.period,
            late=scene.late,
        )
    ]


def figure_table(scene: Scene) -> list[dict[str, object]]:
    """Each figure of each robot that has some, with where it is from."""
    return [
        {"robot": name, **row}
        for name, robot in scene.robots.items()
        if robot.stopping is not None
        for row in figures_of(robot.stopping)
    ]


def figures_of(figures: StoppingFigures) -> list[dict[str, object]]:
    """Figures of one robot: name, value or values by joint, unit, source."""
    rows: list[dict[str, object]] = []
    meaning = meanings(StoppingFigures)
    for name in names_of_figures():
        value, unit = getattr(figures, name), UNIT.search(meaning[name])
        if hasattr(value, "tolist"):
            value = dict(zip(figures.joints, value.tolist(), strict=True))
        rows.append(
            {
                "figure": name,
                "value": value,
                "unit": unit and unit[1].replace(" or ", ", "),
                "source": source_of(figures, name),
            }
        )
    for joint, table in figures.tables.items():
        columns = zip(table.speeds, table.times, table.travels, strict=True)
        rows.append(
            {
                "figure": f"table of {joint}",
                "value": list(map(list, columns)),
                "unit": "rad/s, s, rad or m/s, s, m",
                "source": source_of(figures, "tables"),
            }
        )
    return rows


def names_of_figures() -> list[str]:
    """Names of the figures, in their order."""
    names = (field.name for field in fields(StoppingFigures))
    return [name for name in names if name not in BESIDE]


def source_of(figures: StoppingFigures, key: str) -> str:
    """Where a figure is from; "declared" if its user declared it."""
    return figures.sources.get(key) or "declared"


def stopping_findings(scene: Scene) -> list[Finding]:
    """One line a robot: the basis of its distances."""
    return [stopping_finding(robot, scene) for robot in scene.robots.values()]


def stopping_finding(robot: SceneRobot, scene: Scene) -> Finding:
    """The basis of one robot's distances; a WARN if on assumptions."""
    mode, keys = f"mode {robot.mode}", ("robots", robot.name)
    figures = robot.stopping
    if robot.mode == "fixed":
        first = next(iter(robot.fits))
        buffer = scene.buffer_of(f"{robot.name}/{first}") * 1e3
        declared = (
            "its stopping figures are declared, not used"
            if figures
            else "it has no stopping figures"
        )
        sentence = f"{mode}: {buffer:.2f} mm at every speed; {declared}"
        if all(other.mode == "fixed" for other in scene.robots.values()):
            return Finding("stopping", "PASS", sentence, keys=keys)
        return Finding(
            "stopping",
            "WARN",
            f"{sentence}; the proofs of its neighbours count it as still, so nothing "
            "is proven about its motion",
            "give it stopping figures, those of your robot, and the mode path",
            keys,
            f"mode: path\n{STOPPING}",
        )
    if figures is None:
        return lacking_figures_finding(keys, stopping_line(robot.model))
    sources = {name: source_of(figures, name) for name in names_of_figures()}
    assumed = [name for name, source in sources.items() if ASSUMPTION.strip() in source]
    if not assumed:
        sentence = f"{mode}: every figure has a source"
        return Finding("stopping", "PASS", sentence, keys=keys)
    rounded = [float(f"{value:.4g}") for value in figures.deceleration]
    least = dict(zip(figures.joints, rounded, strict=True))
    value = next(iter(least.values())) if len(set(least.values())) == 1 else least
    return Finding(
        "stopping",
        "WARN",
        f"{mode}: {len(assumed)} figures are assumptions (--verbose lists them)",
        "declare the figures of your robot, see docs/stopping.md, first this one",
        keys,
        f"stopping: {in_yaml({'deceleration': value})}",
    )


def lacking_figures_finding(keys: tuple[str, ...], paste: str) -> Finding:
    """A robot without stopping figures, and the line that declares them."""
    return Finding(
        "stopping",
        "FAIL",
        "no stopping figures; every mode but fixed needs them",
        "declare the least deceleration of a controlled stop [rad/s² or m/s²]; this "
        "value is a guess, measure it",
        keys,
        paste,
    )


def show_stops(scene: Scene) -> None:
    """Print stops and figures for people."""
    stops = stop_table(scene)
    if not stops:
        return
    out.print(
        "\nstopping: how far each link's farthest point goes on, and how long, at any "
        "pose,\nevery joint from this share of its top speed, a cycle every "
        f"{scene.period * 1e3:g} ms, late by {scene.late * 1e3:g} ms:",
        soft_wrap=True,
    )
    shares = sorted({int(str(s["speed_percent"])) for s in stops})
    head = "".join(f"{f'{share} %':>16}" for share in shares)
    out.print(f"  {'':30}{head}", soft_wrap=True)
    for link in dict.fromkeys(str(s["link"]) for s in stops):
        own = [s for s in stops if s["link"] == link]
        if not any(s["time_ms"] for s in own):
            continue
        cells = "".join(
            f"{s['distance_mm']:>6.0f} mm{s['time_ms']:>4.0f} ms" for s in own
        )
        out.print(f"  {link:30}{cells}", markup=False, soft_wrap=True)
    shown: dict[str, list[dict[str, object]]] = {}
    for name, robot in scene.robots.items():
        if robot.stopping is None:
            continue
        rows = figures_of(robot.stopping)
        like = next((other for other, known in shown.items() if known == rows), None)
        if like is not None:
            out.print(f"\nfigures of robot '{name}': as of '{like}'", markup=False)
            continue
        shown[name] = rows
        out.print(f"\nfigures of robot '{name}', and where each is from:", markup=False)
        for row in rows:
            value = f"{short(row['value'])} {row['unit']}"
            out.print(
                f"  {row['figure']:20} {value:30} {row['source']}",
                markup=False,
                soft_wrap=True,
            )


def short(value: object) -> str:
    """A value, or the range of values by joint."""
    if isinstance(value, dict):
        low, high = min(value.values()), max(value.values())
        return f"{low:g}" if low == high else f"{low:g} … {high:g}"
    if isinstance(value, list):
        return f"{len(value)} speeds"
    return f"{value:g}"
