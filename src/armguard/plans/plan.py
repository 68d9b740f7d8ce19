"""A plan: where its controllers move all joints of a scene over time."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.batch.room import LARGEST_ANGLE
from armguard.errors import TrajectoryError, did_you_mean
from armguard.plans.splines import (
    DEGREES,
    Interpolation,
    control_points,
    fitted_rates,
)
from armguard.prove.tube import Tube
from armguard.recording.motions import load_motion, motion_notes
from armguard.scene import Scene, SceneTables, Trajectory
from armguard.scene.trajectory_times import check_unit

Floats = NDArray[np.float64]

# A figure for all joints or robots, or some by name.
ByName = float | Mapping[str, float]

# Time of the way to the first row where no joint has a declared speed [s].
WAY_TIME = 1.0


@dataclass(frozen=True, slots=True)
class Plan:
    """Curves of all joints of a scene, and how far controllers may be off them.

    Attributes:
        source: Where it is from.
        tube: The curves, without a width; times are numbers of rows if it has none.
        timed: Whether it has times.
        interpolation: What its controllers make of the rows; "mixed" where rows differ
            in what they give.
        notes: What its reader had to decide, each a sentence.
    """

    source: str
    tube: Tube
    timed: bool
    interpolation: str
    notes: tuple[str, ...] = ()

    @classmethod
    def read(
        cls,
        path: str | Path,
        scene: Scene,
        *,
        interpolation: Interpolation | None = None,
        start: ArrayLike | None = None,
        hold_home: bool = False,
    ) -> Self:
        """Read a plan from a file.

        Args:
            path: CSV, NPZ, YAML or JSON as `load_trajectory` reads them, a bag or a
                recording; or NPY, one row for each configuration of the scene.
            scene: The scene.
            interpolation: See `of`.
            start: See `of`.
            hold_home: See `of`.

        Raises:
            TrajectoryError: It holds no plan of this scene.
        """
        path = Path(path)
        if path.suffix.lower() == ".npy":
            motion = read_rows(path, scene)
        else:
            motion = load_motion(path)
        return cls.of(
            motion,
            scene,
            interpolation=interpolation,
            start=start,
            hold_home=hold_home,
        )

    @classmethod
    def of(
        cls,
        motion: Trajectory,
        scene: Scene,
        *,
        interpolation: Interpolation | None = None,
        start: ArrayLike | None = None,
        hold_home: bool = False,
    ) -> Self:
        """The plan that controllers make of waypoints.

        Args:
            motion: The waypoints.
            scene: The scene.
            interpolation: Curves between two waypoints: "linear"; "cubic", with their
                velocities; "quintic", with their accelerations too. Where a motion has
                none of these, they are those of the smoothest spline that rests at both
                ends. By default as in the trajectory controller of ROS: a quintic
                between waypoints that have accelerations, a cubic between those that
                have velocities, else a line.
            start: Joint positions at which the arms rest before, shape (n,). The way
                from there to the first row belongs to the plan: during the time that
                the first row has, or at the joints' top speeds [rad or m].
            hold_home: Whether joints that the waypoints do not have stay at home.

        Raises:
            TrajectoryError: It is no plan of this scene.
        """
        source = motion.source
        if motion.ends_only:
            raise TrajectoryError(
                f"{source}: a request has no way between start and goal; give the "
                "planned trajectory"
            )
        home = dict(zip(scene.q_names, scene.home.tolist(), strict=True))
        q = motion.for_scene(scene, home if hold_home else None)
        times, timed = motion.stamps, motion.stamps is not None
        if times is None:
            times = np.arange(len(q), dtype=np.float64)
        check_rows(motion, scene, q, times)
        if timed and not motion.unit_known:
            check_pace(source, scene, q, times)
        v, a = motion.rates_for_scene(scene)
        check_rates(source, scene, v, a)
        if start is not None:
            here = start_of(start, scene)
            q, times = np.vstack((here, q)), times_from(times, here, q[0], scene, timed)
            v, a = (None if r is None else np.vstack((0.0 * here, r)) for r in (v, a))
        notes = motion_notes(motion, scene)
        tube, kind = curves_of(source, times, q, (v, a), interpolation, timed)
        return cls(source, tube, timed, kind, tuple(notes))

    @property
    def duration(self) -> float:
        """Time from its first row to its last [s], or count of lines without time."""
        return float(self.tube.times[-1] - self.tube.times[0])

    def widened(
        self,
        scene: Scene | SceneTables,
        following_error: ByName = 0.0,
        skew: ByName = 0.0,
    ) -> Tube:
        """The tube that holds what controllers execute.

        Args:
            scene: The scene, or its tables.
            following_error: How far a joint may be off its curve, for all or by name of
                a robot or of 'robot/joint' [rad or m].
            skew: How far a robot's clock may be off, for all or by robot [s].

        Raises:
            TrajectoryError: A figure is negative or not finite, a name is unknown, or
                the plan has no time and a clock is off.
        """
        off = figures_by_joint("following_error", following_error, scene.q_names)
        late = figures_by_joint("skew", skew, scene.q_names)
        if late.any() and not self.timed:
            raise TrajectoryError(
                f"{self.source}: it has no times, so no clock can be off; give times, "
                "or leave out the skew"
            )
        wide = np.tile(off, (len(self.tube.control), 1))
        for one in np.unique(late[late > 0.0]):
            own = late == one
            speeds = speeds_near(self.tube, float(one))
            wide[:, own] += one * speeds[:, own]
        return self.tube.widened(wide)


def read_rows(path: Path, scene: Scene) -> Trajectory:
    """Rows of an NPY file, in the order of a scene's joints."""
    try:
        q = np.load(path, allow_pickle=False)
    except OSError as error:
        raise TrajectoryError(
            f"'{path}' cannot be read: {error.strerror or error}"
        ) from None
    except (ValueError, EOFError) as error:
        raise TrajectoryError(f"'{path.name}' is no NPY file: {error}") from None
    if q.ndim != 2 or q.shape[1] != len(scene.q_names) or q.dtype.kind not in "fiu":
        raise TrajectoryError(
            f"{path.name}: it holds {q.dtype} of shape {q.shape}; it must hold "
            f"numbers, (rows, {len(scene.q_names)}), a column for each of: "
            f"{', '.join(scene.q_names)}"
        )
    return Trajectory(scene.q_names, np.asarray(q, dtype=np.float64), None, path.name)


def check_rows(motion: Trajectory, scene: Scene, q: Floats, times: Floats) -> None:
    """Refuse rows that no controller could execute.

    Raises:
        TrajectoryError: There are fewer than two, a number is not finite or far too
            large, or time does not rise.
    """
    source = motion.source
    if len(q) < 2:
        raise TrajectoryError(
            f"{source}: it has one configuration; a plan needs two or more"
        )
    bad = ~(np.abs(q) < LARGEST_ANGLE / 10.0)
    if bad.any():
        row, joint = np.argwhere(bad)[0]
        raise TrajectoryError(
            f"{source}: configuration {row + 1}: joint '{scene.q_names[joint]}' is at "
            f"{q[row, joint]:g}; give a number in radians or metres"
        )
    for k in np.flatnonzero(~(np.diff(times) > 0.0)):
        raise TrajectoryError(
            f"{source}: time goes from {times[k]:.9g} s to {times[k + 1]:.9g} s at "
            f"configuration {k + 2}; it must rise: correct it, or delete one of both"
        )


def check_pace(source: str, scene: Scene, q: Floats, times: Floats) -> None:
    """Refuse times that do not look like seconds."""
    passed = np.diff(times)
    speeds = np.abs(np.diff(q, axis=0) / passed[:, None]).max(axis=0)
    used = {}
    for name, speed in zip(scene.q_names, speeds.tolist(), strict=True):
        robot, joint = name.split("/", 1)
        limit = scene.robots[robot].model.joints[joint].velocity
        if limit:
            used[name] = speed / limit
    check_unit(source, used, float(np.median(passed)))


def check_rates(source: str, scene: Scene, *rates: Floats | None) -> None:
    """Refuse velocities and accelerations that are infinite, or given in part."""
    for name, values in zip(("velocity", "acceleration"), rates, strict=True):
        if values is None:
            continue
        lacks = np.isnan(values)
        whole = lacks.all(axis=1, keepdims=True)
        bad = np.asarray(np.isinf(values) | (lacks & ~whole))
        if bad.any():
            row, joint = np.argwhere(bad)[0]
            raise TrajectoryError(
                f"{source}: configuration {row + 1}: the {name} of joint "
                f"'{scene.q_names[joint]}' is {values[row, joint]:g}; give a finite "
                "number for each joint of the row, or none"
            )


def start_of(start: ArrayLike, scene: Scene) -> Floats:
    """Joint positions before a plan, shape (1, n)."""
    here = np.asarray(start, dtype=np.float64)
    if here.shape != (len(scene.q_names),) or not np.isfinite(here).all():
        raise TrajectoryError(
            f"start has shape {here.shape}; it must hold {len(scene.q_names)} finite "
            f"numbers, one for each of: {', '.join(scene.q_names)}"
        )
    return here[None]


def times_from(
    times: Floats, here: Floats, first: Floats, scene: Scene, timed: bool
) -> Floats:
    """Times with that of the start before them."""
    if not timed:
        return np.concatenate(([times[0] - 1.0], times))
    if times[0] > 0.0:
        return np.concatenate(([0.0], times))
    needed = [WAY_TIME]
    for name, way in zip(scene.q_names, np.abs(first - here[0]).tolist(), strict=True):
        robot, joint = name.split("/", 1)
        speed = scene.robots[robot].model.joints[joint].velocity
        needed.append(way / speed if speed else 0.0)
    return np.concatenate(([times[0] - max(needed)], times))


def curves_of(
    source: str,
    times: Floats,
    q: Floats,
    rates: tuple[Floats | None, Floats | None],
    interpolation: Interpolation | None,
    timed: bool,
) -> tuple[Tube, str]:
    """Curves between rows, and the name of their interpolation.

    Raises:
        TrajectoryError: The rows do not have what the interpolation needs.
    """
    nothing = np.full(q.shape, np.nan)
    v, a = (nothing if one is None else one for one in rates)
    if interpolation not in (None, "linear") and not timed:
        raise TrajectoryError(
            f"{source}: it has no times, so '{interpolation}' is no curve of it; give "
            "times, or 'linear'"
        )
    if interpolation is not None:
        degree = DEGREES[interpolation]
        needed = {1: (), 3: (v,), 5: (v, a)}[degree]
        lacking = np.array([np.isnan(one[:, 0]) for one in needed], dtype=bool)
        if lacking.all() and degree > 1:
            v, a = fitted_rates(source, times, q, degree)
        elif lacking.any():
            row = int(np.argwhere(lacking)[0][1])
            raise TrajectoryError(
                f"{source}: configuration {row + 1} lacks what '{interpolation}' "
                "needs: give velocities, and accelerations for 'quintic', in all rows "
                "or in none"
            )
        kinds = np.full(len(q) - 1, degree)
    else:
        moving, bending = (~np.isnan(one[:, 0]) for one in (v, a))
        curved = moving[1:] & moving[:-1] & timed
        kinds = np.where(curved, np.where(curved & bending[1:] & bending[:-1], 5, 3), 1)
    names = {degree: name for name, degree in DEGREES.items()}
    used = np.unique(kinds)
    kind = names[int(used[0])] if len(used) == 1 else "mixed"
    control = control_points(times, q, v, a, kinds)
    return Tube(times, control, np.zeros((len(kinds), q.shape[1]))), kind


def figures_by_joint(what: str, value: ByName, names: tuple[str, ...]) -> Floats:
    """A figure of each joint, shape (n,).

    Raises:
        TrajectoryError: A figure is negative or not finite, or a name is unknown.
    """
    given = value if isinstance(value, Mapping) else {"": value}
    found = np.zeros(len(names))
    robots = {name.split("/", 1)[0] for name in names}
    # A joint's own figure counts more than its robot's.
    for key in sorted(given, key=lambda name: name.count("/")):
        chosen = [key in ("", name, name.split("/", 1)[0]) for name in names]
        if not any(chosen):
            known = [*sorted(robots), *names]
            raise TrajectoryError(
                f"{what} is given for '{key}', no robot or joint; "
                f"{did_you_mean(key, known)}"
            )
        number = float(given[key])
        if not 0.0 <= number < np.inf:
            raise TrajectoryError(f"{what} is {number:g}; it must be finite and >= 0")
        found[chosen] = number
    return found


def speeds_near(tube: Tube, skew: float) -> Floats:
    """Bound of each joint's speed from a skew before each segment to one after it.

    Returns:
        Shape (s, n) [rad/s or m/s].
    """
    speeds, count = tube.top_speeds(), len(tube.control)
    first, _ = tube.place(tube.times[:-1] - skew)
    last, _ = tube.place(tube.times[1:] + skew)
    # Level k of the table has the greatest of 2^k segments from each on.
    levels = [speeds]
    while 2 ** len(levels) <= count:
        width = 2 ** (len(levels) - 1)
        levels.append(np.maximum(levels[-1][:-width], levels[-1][width:]))
    found = np.empty_like(speeds)
    for level, table in enumerate(levels):
        width = 2**level
        fits = (last - first + 1 >= width) & (last - first + 1 < 2 * width)
        ends = last[fits] + 1 - width
        found[fits] = np.maximum(table[first[fits]], table[ends])
    return found
