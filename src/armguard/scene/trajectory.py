"""Motion to be judged: configurations by joint name, with or without time."""

from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armguard.errors import TrajectoryError, did_you_mean, known_names
from armguard.robot.limits import other_unit
from armguard.scene.scene import Scene

Floats = NDArray[np.float64]

# What is between a robot's name and its joint's in the names of others: ours,
# ROS's prefix, and that of some log files.
SEPARATORS = ("/", "_", ".")


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Configurations in the order of a file's joints.

    Attributes:
        names: 'robot/joint', 'robot_joint', or 'joint' as written.
        q: Joint positions, shape (n, k) [rad or m].
        stamps: Times, shape (n,) [s], None if the file has none.
        source: Where it came from.
        ends_only: True if only start and goal are known, not the way between them.
        others: Whether it may also hold joints that the scene does not have: a log of
            a whole machine does, a table made for this scene does not.
        notes: What its reader had to decide, each a sentence.
        unit_known: Whether the source names the unit of its times.
        velocities: Joint velocities, NaN in rows without, shape (n, k), None if no row
            has any [rad/s or m/s].
        accelerations: Joint accelerations, likewise [rad/s² or m/s²].
    """

    names: tuple[str, ...]
    q: Floats
    stamps: Floats | None
    source: str
    ends_only: bool = False
    others: bool = False
    notes: tuple[str, ...] = ()
    unit_known: bool = True
    velocities: Floats | None = None
    accelerations: Floats | None = None

    def for_scene(
        self, scene: Scene, fill: Mapping[str, float] | None = None
    ) -> Floats:
        """Configurations in the order of a scene's joints, shape (n, len(q_names)).

        A bare name serves every scene joint of that name if there is just one.
        Columns of fixed joints, and of joints that mimic others, are left out: their
        positions follow.

        Args:
            scene: The scene.
            fill: Positions of joints the file does not have, by 'robot/joint'.

        Raises:
            TrajectoryError: A joint is unknown, ambiguous, given twice, or missing; or
                its positions are degrees or millimetres.
        """
        fill, joints = fill or {}, scene.q_names
        column, unknown = self._columns(scene)
        absent = [j for j in joints if j not in column]
        for name in unknown:
            if not self.others or is_like(name, absent):
                near = did_you_mean(name, sorted(joints, key=column.__contains__))
                robot, slash, _ = name.partition("/")
                if slash and robot not in scene.robots:
                    near = f"no robot is named '{robot}': {known_names(scene.robots)}"
                elif self.stamps is None and len(self.q) > 1 and self._rises(name):
                    near += "; if it holds times, name it 't'"
                raise self._wrong(f"joint '{name}' is not in the scene; {near}")
        missing = ", ".join(f"'{j}'" for j in absent if j not in fill)
        if missing:
            raise self._wrong(
                f"no positions for {missing}; add columns, or hold them at home with "
                "--hold-home"
            )
        self._check_unit(scene, column)
        return np.column_stack(
            [
                self.q[:, column[j]] if j in column else np.full(len(self.q), fill[j])
                for j in joints
            ]
        )

    def rates_for_scene(self, scene: Scene) -> tuple[Floats | None, Floats | None]:
        """Velocities and accelerations as `for_scene` orders positions.

        Joints that the file does not have rest.
        """
        column, _ = self._columns(scene)
        found: list[Floats | None] = []
        for rates in (self.velocities, self.accelerations):
            if rates is None:
                found.append(None)
                continue
            placed = np.zeros((len(rates), len(scene.q_names)))
            for place, joint in enumerate(scene.q_names):
                if joint in column:
                    placed[:, place] = rates[:, column[joint]]
            found.append(placed)
        return found[0], found[1]

    def unused(self, scene: Scene) -> tuple[str, ...]:
        """Names of the file that are no joint of the scene."""
        return tuple(self._columns(scene)[1])

    def _columns(self, scene: Scene) -> tuple[dict[str, int], list[str]]:
        """Column of each scene joint the file has, and names it does not know."""
        known = [
            (name, joint)
            for name, robot in scene.robots.items()
            for joint in robot.model.joints
        ]
        column: dict[str, int] = {}
        unknown: list[str] = []
        for k, name in enumerate(self.names):
            joint = self._match(name, known)
            if joint is None:
                unknown.append(name)
            elif joint in column:
                first = self.names[column[joint]]
                raise self._wrong(
                    f"joint '{joint}' has two columns, '{first}' and '{name}'; "
                    "delete one"
                )
            else:
                column[joint] = k
        return column, unknown

    def _match(self, name: str, known: list[tuple[str, str]]) -> str | None:
        """The one scene joint of a column's name; None if there is none."""
        bare = name.strip("/")
        if tuple(bare.split("/", 1)) in known:
            return bare
        matches = [
            f"{robot}/{joint}"
            for robot, joint in known
            if bare in (joint, *(f"{robot}{sign}{joint}" for sign in SEPARATORS))
        ]
        if len(matches) > 1:
            either = " or ".join(f"'{m}'" for m in matches)
            raise self._wrong(
                f"joint '{name}' may be {either}; write the robot's name before it"
            )
        return matches[0] if matches else None

    def _rises(self, name: str) -> bool:
        """Whether a column becomes greater from row to row, as times do."""
        return bool((np.diff(self.q[:, self.names.index(name)]) > 0.0).all())

    def _check_unit(self, scene: Scene, column: Mapping[str, int]) -> None:
        """Refuse positions that can only be degrees or millimetres."""
        if not len(self.q):
            return
        low, high = self.q.min(axis=0), self.q.max(axis=0)
        farthest = np.where(-low > high, low, high)
        for name, k in column.items():
            robot, joint = name.split("/", 1)
            model = scene.robots[robot].model.joints[joint]
            if np.isfinite(farthest[k]) and not other_unit(model, farthest[k]):
                continue
            far = np.nan_to_num(self.q[:, k], nan=0.0, posinf=0.0, neginf=0.0)
            row = int(np.abs(far).argmax())
            hint = other_unit(model, far[row])
            if hint:
                raise self._wrong(
                    f"configuration {row + 1}: joint '{self.names[k]}' is at "
                    f"{far[row]:g}, {hint}; its limits are "
                    f"[{model.lower:g}, {model.upper:g}]"
                )

    def _wrong(self, sentence: str) -> TrajectoryError:
        return TrajectoryError(f"{self.source}: {sentence}")


def is_like(name: str, others: list[str]) -> bool:
    """Whether a name may be a misspelling of one of these.

    Robots' joints differ by a digit, so that the right spelling of one is like another:
    only what is nearly the same counts.
    """
    return bool(get_close_matches(name, others, n=1, cutoff=0.8))


def densify(q: Floats, max_step: float) -> Floats:
    """Straight lines in joint space between configurations, in small steps.

    Args:
        q: Configurations, shape (n, k) [rad or m].
        max_step: Largest step of any joint between two rows [rad or m].

    Returns:
        Configurations; every row of `q` is among them, bit for bit.

    Raises:
        TrajectoryError: The step is not a positive number.
    """
    if not max_step > 0.0:
        raise TrajectoryError(f"max_step is {max_step}; it must be > 0")
    pieces = []
    for before, after in pairwise(q):
        largest = float(np.abs(after - before).max(initial=0.0))
        finite = np.isfinite(largest)
        steps = max(int(np.ceil(largest / max_step)), 1) if finite else 1
        fractions = np.arange(steps)[:, None] / steps
        with np.errstate(invalid="ignore"):
            piece = before + fractions * (after - before)
        piece[0] = before
        pieces.append(piece)
    return np.concatenate([*pieces, q[-1:]])
