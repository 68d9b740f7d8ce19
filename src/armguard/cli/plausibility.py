"""Plausibility in `armguard check`: lengths, speeds and stops that are seldom true."""

from collections.abc import Iterator, Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from armguard.cli.finding import Finding, in_yaml
from armguard.errors import SceneError
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Box
from armguard.robot.model import JointKind
from armguard.robot.stopping import stop_distances
from armguard.robot.stopping.declared import DEFAULTS
from armguard.scene import compile_scene
from armguard.scene.blocks import extent
from armguard.scene.scene import Scene, SceneRobot
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Few arms turn a joint faster than this [rad/s].
FAST = 4.0

# Larger lengths of a scene are probably millimetres [m].
LARGE = 20.0

# Unreachable objects that are listed.
LISTED = 3


def plausibility_findings(scene: Scene) -> Iterator[Finding]:
    """Lengths, speeds and stops of a scene that are seldom true."""
    try:
        tables = compile_scene(scene)
    except SceneError:
        # The guard reports it.
        return
    reach = reaches(scene, tables)
    found = [
        *far_bases(scene, reach),
        *object_findings(scene, tables, reach),
        *(
            finding
            for robot in scene.robots.values()
            for finding in speed_findings(scene, robot, reach[robot.name])
        ),
    ]
    yield from found or [
        Finding("plausibility", "PASS", "lengths, speeds and stops are plausible")
    ]


def reaches(scene: Scene, tables: SceneTables) -> dict[str, float]:
    """Radius about each robot's base that its links do not leave [m]."""
    return {
        name: float(tables.base_reach[tables.robot_of_primitive == k].max(initial=0.0))
        for k, name in enumerate(scene.robots)
    }


def far_bases(scene: Scene, reach: Mapping[str, float]) -> Iterator[Finding]:
    """Two robots that cannot meet, each with a base in millimetres, or the second."""
    for a, b in combinations(scene.robots.values(), 2):
        way = np.subtract(b.base.xyz, a.base.xyz)
        apart, both = float(np.linalg.norm(way)), reach[a.name] + reach[b.name]
        if apart <= both:
            continue
        large = [robot for robot in (a, b) if np.linalg.norm(robot.base.xyz) > LARGE]
        for robot in large or [b]:
            other = a if robot is b else b
            xyz = a.base.xyz + both / 2.0 / apart * way
            if large:
                xyz = 1e-3 * np.array(robot.base.xyz)
            yield Finding(
                "plausibility",
                "WARN",
                f"it is {apart:g} m from '{other.name}'; they reach "
                f"{reach[robot.name]:.2f} m and {reach[other.name]:.2f} m, so they "
                "never meet" + (": millimetres?" if large else ""),
                "give metres, or check them as two scenes",
                ("robots", robot.name),
                f"base: {moved(robot.base, xyz)}",
            )


def moved(pose: Pose, xyz: Floats) -> str:
    """A pose at another place, as YAML."""
    place = {"xyz": np.round(xyz, 4).tolist()}
    if any(pose.rpy):
        place["rpy"] = list(pose.rpy)
    return in_yaml(place)


def object_findings(
    scene: Scene, tables: SceneTables, reach: Mapping[str, float]
) -> Iterator[Finding]:
    """Objects that are very large, and fixtures that no robot reaches."""
    unreached = []
    for name, item in scene.objects.items():
        first, end = tables.holds.places[name]
        box = np.zeros(6)
        extent(tables.kinds[first:end], tables.local_rows[first:end], box)
        size = float((box[3:] - box[:3]).max())
        if np.isfinite(box).all() and size > LARGE:
            yield large_object(scene, name, size)
        elif item.attached_to is None and not item.movable:
            room = min(
                gap(np.array(robot.base.xyz), box) - reach[robot.name]
                for robot in scene.robots.values()
            )
            unreached += [(name, room)] if room > 0.0 else []
    for name, room in unreached[:LISTED]:
        more = len(unreached) - LISTED
        also = f"; {more} more objects are out of reach" if more > 0 else ""
        yield Finding(
            "plausibility",
            "WARN",
            f"no robot reaches it, by {room:.2f} m{also}",
            "move it, or delete it",
            ("objects", name),
        )


def gap(point: Floats, box: Floats) -> float:
    """Distance of a point from a box; sides without end are infinitely far [m]."""
    low = np.where(np.isfinite(box[:3]), box[:3], -np.inf)
    high = np.where(np.isfinite(box[3:]), box[3:], np.inf)
    return float(np.linalg.norm(np.maximum(np.maximum(low - point, point - high), 0)))


def large_object(scene: Scene, name: str, size: float) -> Finding:
    """An object that is probably given in millimetres."""
    item = scene.objects[name]
    paste = "scale: 0.001"
    shape = item.shapes[0].shape if item.shapes else None
    if isinstance(shape, Box):
        sizes = [round(2e-3 * half, 5) for half in shape.half_extents]
        at = moved(item.pose, 1e-3 * np.array(item.pose.xyz))
        paste = f"box: {in_yaml(sizes)}\nat: {at}"
    return Finding(
        "plausibility",
        "WARN",
        f"its longest side is {size:g} m: millimetres?",
        "give metres",
        ("objects", name),
        paste,
    )


def speed_findings(scene: Scene, robot: SceneRobot, reach: float) -> Iterator[Finding]:
    """Speed limits of a URDF that few arms have, and stops longer than the arm."""
    figures = robot.stopping
    if figures is None:
        return
    model, keys = robot.model, ("robots", robot.name)
    turning = [
        model.joints[name].kind is not JointKind.PRISMATIC for name in figures.joints
    ]
    tops = dict(zip(figures.joints, figures.velocity.tolist(), strict=True))
    fast = [
        name
        for name, turns in zip(figures.joints, turning, strict=True)
        if turns and tops[name] > FAST
    ]
    if fast and figures.sources.get("velocity") == DEFAULTS["velocity"]:
        worst = max(fast, key=tops.__getitem__)
        yield Finding(
            "plausibility",
            "WARN",
            f"the speed limit of joint '{worst}' is {tops[worst]:g} rad/s in "
            f"{model.file} line {model.joints[worst].line}, and {len(fast)} joints "
            f"exceed {FAST:g} rad/s",
            "declare the top speed that your drives hold",
            keys,
            f"stopping: {in_yaml({'velocity': capped(tops, fast, FAST)})}",
        )
    if robot.mode == "fixed":
        return
    stop = max(
        stop_distances(
            model,
            robot.fits,
            figures,
            period=scene.period,
            late=scene.late,
            shares=(1.0,),
        ),
        key=lambda stop: stop.distance,
    )
    # No point of an arm gets farther than across its workspace.
    if stop.distance > 2.0 * reach:
        share = float(np.sqrt(2.0 * reach / stop.distance))
        slower = {name: float(f"{share * top:.2g}") for name, top in tops.items()}
        least = dict(zip(figures.joints, figures.deceleration.tolist(), strict=True))
        stop_figures = {"velocity": same(slower), "deceleration": same(least)}
        yield Finding(
            "plausibility",
            "WARN",
            f"from top speed {stop.link} goes on for {stop.distance * 1e3:.0f} mm, "
            f"{stop.time * 1e3:.0f} ms; the arm reaches {reach * 1e3:.0f} mm",
            "check velocity and deceleration",
            keys,
            f"stopping: {in_yaml(stop_figures)}",
        )


def capped(tops: Mapping[str, float], fast: list[str], top: float) -> object:
    """Top speeds by joint, the fast ones at a lower speed."""
    return same({name: top if name in fast else v for name, v in tops.items()})


def same(values: Mapping[str, float]) -> object:
    """One number if it is the same for all joints, else numbers by joint."""
    return (
        values[next(iter(values))] if len(set(values.values())) == 1 else dict(values)
    )
