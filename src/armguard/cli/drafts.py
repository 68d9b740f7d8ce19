"""Robots of a new scene, and its commented file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from armguard.cli.finding import in_yaml
from armguard.cli.plausibility import FAST
from armguard.geometry import Pose
from armguard.robot.model import RobotModel
from armguard.robot.tree import rigid_groups
from armguard.scene import Scene
from armguard.scene.gripping import Gripper
from armguard.scene.posture import grippings

SCHEMA = "armguard.schema.json"


@dataclass(slots=True)
class Draft:
    """A robot of the new scene.

    Attributes:
        name: Its name in the scene.
        source: Its entry `urdf` in the file.
        model: The robot.
        is_named: Whether the source is a robot's name.
        srdf: Its entry `srdf`, None if it has none.
        xacro_args: Its entry `xacro_args`.
        stopping: Assumed figures; empty for a robot that brings its own.
        base: Its base.
        home: Positions that were searched; empty if its own home is free.
    """

    name: str
    source: str
    model: RobotModel
    is_named: bool = False
    srdf: str | None = None
    xacro_args: dict[str, str] = field(default_factory=dict)
    stopping: dict[str, Any] = field(default_factory=dict)
    base: Pose = field(default_factory=Pose)
    home: dict[str, float] = field(default_factory=dict)

    @property
    def gripper(self) -> Gripper | None:
        """The gripper, where fingers are recognised."""
        links = self.model.links.values()
        groups = rigid_groups(self.model)
        for found in grippings(self.model, {x.name for x in links if x.collisions}):
            if groups[found.carrier] != groups[self.model.root]:
                return Gripper(link=found.carrier, fingers=found.fingers)
        return None


def scene_text(
    scene: Scene, drafts: list[Draft], file: str, packages: Mapping[str, str]
) -> str:
    """The commented scene file."""
    period, late = f"{scene.period:g}", f"{scene.late:g}"
    lines = [
        f"# yaml-language-server: $schema=./{SCHEMA}",
        "# Metres, seconds, radians; world z up. Values marked ASSUMED are guesses:",
        f"# replace them, then run `armguard check {file}`.",
        "",
        "cycle:",
        "  # Time from one call of the guard to the next [s]. It must be the period of",
        f"  # your loop, here {1.0 / scene.period:g} Hz: a slower loop is stopped.",
        f"  period: {period}",
        "  # How much later than that a call may come [s]. ASSUMED: a tenth.",
        f"  late: {late}",
        "",
        *([f"packages: {in_yaml(dict(packages))}", ""] if packages else []),
        "robots:",
    ]
    for draft in drafts:
        lines += robot_lines(draft)
    table = scene.objects.get("table")
    if table is not None:
        size, at = table_size(table.shapes[0].shape), {"xyz": rounded(table.pose.xyz)}
        lines += [
            "",
            "objects:",
            "  # ASSUMED: full size [m], and the place of its centre.",
            f"  table: {in_yaml({'box': size, 'at': at})}",
        ]
    if scene.allowances:
        lines += ["", "# Pairs that may touch; they are not checked.", "allow:"]
        lines += [
            f"  - {in_yaml({'a': pair.a, 'b': pair.b, 'reason': pair.reason})}"
            for pair in scene.allowances
        ]
    if scene.pair_buffers:
        lines += [
            "",
            "# Pairs that are nearer than their buffers by construction [m].",
            "buffers:",
        ]
        lines += [
            f"  - {in_yaml({'a': a, 'b': b, 'buffer': value})}"
            for (a, b), value in scene.pair_buffers.items()
        ]
    return "\n".join(lines) + "\n"


def robot_lines(draft: Draft) -> list[str]:
    """The entry of a robot."""
    base = {"xyz": rounded(draft.base.xyz)}
    given = {"srdf": draft.srdf, "xacro_args": draft.xacro_args}
    if any(draft.base.rpy):
        base["rpy"] = rounded(draft.base.rpy)
    lines = [
        f"  {draft.name}:",
        f"    urdf: {in_yaml(draft.source)}",
        *(f"    {key}: {in_yaml(value)}" for key, value in given.items() if value),
        "    # Frame of its root link in the world. ASSUMED.",
        f"    base: {in_yaml(base)}",
    ]
    if draft.home:
        lines += [
            "    # A posture in which nothing touches, found by a search [rad or m].",
            f"    home: {in_yaml(draft.home)}",
        ]
    if draft.stopping:
        lines += stopping_lines(draft)
    else:
        lines.append(
            "    # Its stopping figures are known by its name; `check -v` lists them."
        )
    if draft.gripper is not None:
        gripper = {"link": draft.gripper.link, "fingers": list(draft.gripper.fingers)}
        lines += [
            "    # Its fingers may touch objects with `graspable: true`.",
            f"    gripper: {in_yaml(gripper)}",
        ]
    return lines


def stopping_lines(draft: Draft) -> list[str]:
    """The assumed stopping figures of a robot."""
    figures = draft.stopping
    lines = [
        "    # How it stops. The proofs hold if it stops at least this hard.",
        "    stopping:",
        "      # ASSUMED: least deceleration of a controlled stop [rad/s² or m/s²].",
        f"      deceleration: {in_yaml(figures['deceleration'])}",
    ]
    if "velocity" in figures:
        lines += [
            "      # ASSUMED where the robot's file has none: top speeds [rad/s, m/s].",
            f"      velocity: {in_yaml(figures['velocity'])}",
        ]
    else:
        speeds = [
            draft.model.joints[name].velocity or 0.0 for name in draft.model.q_names
        ]
        lines += [
            "      # Top speed [rad/s or m/s]; without this line that of the URDF, at "
            f"most {max(speeds):g}"
            + (", which few arms reach." if max(speeds) > FAST else "."),
            f"      # velocity: {min(max(speeds), FAST):g}",
        ]
    return [*lines, f"      sources: {in_yaml(figures['sources'])}"]


def table_size(box: Any) -> list[float]:
    """Full size of a box [m]."""
    return [round(2.0 * float(half), 4) for half in box.half_extents]


def rounded(values: Any) -> list[float]:
    """Numbers of a pose as the file has them."""
    return [round(float(value), 4) + 0.0 for value in values]
