"""Motion to be judged: configurations by joint name, with or without time."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.errors import TrajectoryError, did_you_mean
from armguard.scene.scene import Scene

Floats = NDArray[np.float64]

# Column names that mean time [s].
TIME_COLUMNS = ("t", "time", "stamp")


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Configurations in the order of a file's joints.

    Attributes:
        names: 'robot/joint', or 'joint' as written.
        q: Joint positions, shape (n, k) [rad or m].
        stamps: Times, shape (n,) [s], None if the file has none.
        source: Where it came from.
        ends_only: True if only start and goal are known, not the way between them.
    """

    names: tuple[str, ...]
    q: Floats
    stamps: Floats | None
    source: str
    ends_only: bool = False

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
            TrajectoryError: A joint is unknown, ambiguous, given twice, or missing.
        """
        fill = fill or {}
        joints = scene.q_names
        every = [
            f"{name}/{joint}"
            for name, robot in scene.robots.items()
            for joint in robot.model.joints
        ]
        column: dict[str, int] = {}
        for k, name in enumerate(self.names):
            joint = self._match(name, every)
            if joint in column:
                raise TrajectoryError(f"{self.source}: joint '{joint}' has two columns")
            column[joint] = k
        missing = [j for j in joints if j not in column and j not in fill]
        if missing:
            raise TrajectoryError(
                f"{self.source}: no positions for "
                + ", ".join(f"'{m}'" for m in missing)
                + "; add columns, or hold them at home with --hold-home"
            )
        return np.column_stack(
            [
                self.q[:, column[j]] if j in column else np.full(len(self.q), fill[j])
                for j in joints
            ]
        )

    def _match(self, name: str, joints: list[str]) -> str:
        """The one scene joint a column's name stands for."""
        if name in joints:
            return name
        matches = [j for j in joints if "/" not in name and j.endswith(f"/{name}")]
        if not matches:
            raise TrajectoryError(
                f"{self.source}: joint '{name}' is not in the scene; "
                f"{did_you_mean(name, joints)}"
            )
        if len(matches) > 1:
            raise TrajectoryError(
                f"{self.source}: joint '{name}' may be "
                + " or ".join(f"'{m}'" for m in matches)
                + "; write the robot's name before it"
            )
        return matches[0]


def load_trajectory(path: str | Path) -> Trajectory:
    """Read a motion: CSV, NPZ, or a MoveIt motion request in YAML.

    CSV: a header of joint names, one configuration a row; a column `t`, `time` or
    `stamp` is time. NPZ: arrays `names`, `q` and, if there is time, `t`.

    Raises:
        TrajectoryError: The file cannot be read as any of these.
    """
    path = Path(path)
    readers = {".csv": read_csv, ".npz": read_npz, ".yaml": read_request}
    reader = readers.get(path.suffix.replace(".yml", ".yaml"))
    if reader is None:
        raise TrajectoryError(
            f"'{path.name}' is no motion file; it must end in .csv, .npz or .yaml"
        )
    try:
        trajectory = reader(path)
    except OSError as error:
        raise TrajectoryError(f"'{path}' cannot be read: {error.strerror}") from None
    if len(trajectory.q) == 0:
        raise TrajectoryError(f"{path.name}: there is no configuration in it")
    if trajectory.stamps is not None:
        back = np.flatnonzero(~(np.diff(trajectory.stamps) >= 0.0))
        if len(back):
            k = int(back[0])
            raise TrajectoryError(
                f"{path.name}: time goes from {trajectory.stamps[k]:g} s to "
                f"{trajectory.stamps[k + 1]:g} s at configuration {k + 2}; "
                "it must not go back"
            )
    return trajectory


def read_csv(path: Path) -> Trajectory:
    """CSV with a header of joint names."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = csv.reader(file)
        header = [name.strip() for name in next(rows, [])]
        if not header or not all(header):
            raise TrajectoryError(
                f"{path.name}:1: the first line must hold the joint names"
            )
        if len(set(header)) < len(header):
            twice = next(n for n in header if header.count(n) > 1)
            raise TrajectoryError(f"{path.name}:1: column '{twice}' is there twice")
        values: list[list[float]] = []
        for row in rows:
            if not row:
                continue
            at = f"{path.name}:{rows.line_num}"
            if len(row) != len(header):
                raise TrajectoryError(
                    f"{at}: {len(row)} columns; the header has {len(header)}"
                )
            try:
                values.append([float(cell) for cell in row])
            except ValueError:
                bad = next(cell for cell in row if not is_number(cell))
                raise TrajectoryError(f"{at}: '{bad}' is no number") from None
    table = np.array(values, dtype=np.float64).reshape(len(values), len(header))
    time = [k for k, name in enumerate(header) if name.lower() in TIME_COLUMNS]
    joints = [k for k in range(len(header)) if k not in time]
    return Trajectory(
        names=tuple(header[k] for k in joints),
        q=table[:, joints],
        stamps=table[:, time[0]] if time else None,
        source=path.name,
    )


def is_number(text: str) -> bool:
    """Whether a cell is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def read_npz(path: Path) -> Trajectory:
    """NPZ with `names`, `q` and perhaps `t`."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            held = {key: arrays[key] for key in arrays.files}
    except ValueError as error:
        raise TrajectoryError(f"'{path.name}' is no NPZ file: {error}") from None
    missing = [key for key in ("names", "q") if key not in held]
    if missing:
        raise TrajectoryError(
            f"{path.name}: there is no array '{missing[0]}'; an NPZ holds `names`, `q` "
            "and perhaps `t`"
        )
    names = tuple(str(name) for name in held["names"])
    q = np.asarray(held["q"], dtype=np.float64)
    if q.ndim != 2 or q.shape[1] != len(names):
        raise TrajectoryError(
            f"{path.name}: q has shape {q.shape}; it must be (n, {len(names)})"
        )
    stamps = held.get("t")
    if stamps is not None and stamps.shape != (len(q),):
        raise TrajectoryError(
            f"{path.name}: t has shape {stamps.shape}; it must be ({len(q)},)"
        )
    return Trajectory(names, q, stamps, path.name)


def read_request(path: Path) -> Trajectory:
    """A MoveIt motion request: its start state, and its joint goal.

    Joints the goal does not name stay where they start. The way between is not part
    of a request.
    """
    from ruamel.yaml import YAML, YAMLError

    try:
        request = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
        state = request["start_state"]["joint_state"]
        start = dict(zip(state["name"], map(float, state["position"]), strict=True))
        goal = dict(start)
        for constraints in request["goal_constraints"]:
            for joint in constraints["joint_constraints"]:
                goal[joint["joint_name"]] = float(joint["position"])
    except (YAMLError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise TrajectoryError(
            f"'{path.name}' is no MoveIt motion request with a start_state and joint "
            f"goal_constraints: {error}"
        ) from None
    unknown = [name for name in goal if name not in start]
    if unknown:
        raise TrajectoryError(
            f"{path.name}: the goal names joint '{unknown[0]}', which has no start; "
            f"{did_you_mean(unknown[0], start)}"
        )
    names = tuple(start)
    q = np.array([[state[n] for n in names] for state in (start, goal)])
    return Trajectory(names, q, None, path.name, ends_only=True)


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
