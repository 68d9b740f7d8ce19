"""Proofs over whole plans in a scene."""

from math import inf
from pathlib import Path

from numpy.typing import ArrayLike

from armguard.batch.checker import Checker
from armguard.errors import TrajectoryError
from armguard.plans.certificate import Certificate, scene_hash
from armguard.plans.plan import ByName, Plan, figures_by_joint
from armguard.plans.proof import PlanProof
from armguard.plans.splines import Interpolation
from armguard.plans.stop_order import stop_order
from armguard.prove.paving import NearInterval, Paver
from armguard.prove.tile_search import LABEL, LOWER, PAIR, PLACE
from armguard.prove.tube import Tube
from armguard.prove.tube_tiles import HIGH, LOW
from armguard.scene import Scene, Trajectory

# Ends of intervals are this exact: in time [s], and without time in rows [-].
RESOLUTION = 5e-5
ROW_RESOLUTION = 1e-3


class PlanVerifier:
    """Proves plans in the world of one scene.

    Attributes:
        scene: The scene.
        checker: A checker of it; `place` and `remove` change the world.

    Args:
        scene: The scene.

    Raises:
        SceneError: The scene contradicts itself.

    Example:
        >>> import numpy as np
        >>> import armguard as ag
        >>> scene = ag.bay_scene()
        >>> verifier = ag.PlanVerifier(scene)
        >>> rows = [scene.home, scene.home + 0.01]
        >>> motion = ag.Trajectory(scene.q_names, np.array(rows), None, "a line")
        >>> verifier.verify(ag.Plan.of(motion, scene)).clear
        True
    """

    def __init__(self, scene: Scene) -> None:
        self.scene, self.checker = scene, Checker(scene)
        self._paver = Paver(self.checker)

    def verify(
        self,
        plan: Plan,
        *,
        following_error: ByName = 0.0,
        skew: ByName = 0.0,
        resolution: float | None = None,
    ) -> PlanProof:
        """Prove what can be proven of a plan, and list the rest.

        Args:
            plan: The plan.
            following_error: How far a joint may be off its curve, for all or by name of
                a robot or of 'robot/joint' [rad or m].
            skew: How far a robot's clock may be off, for all or by robot [s].
            resolution: How exact the ends of intervals are; by default 0.05 ms, or a
                thousandth of a row without time [s].

        Raises:
            TrajectoryError: A figure is no such figure, or a name is unknown.
        """
        if resolution is None:
            resolution = RESOLUTION if plan.timed else ROW_RESOLUTION
        if not 0.0 < resolution < inf:
            raise TrajectoryError(f"resolution is {resolution}; it must be > 0")
        tube = plan.widened(self.scene, following_error, skew)
        found = self._intervals(tube, resolution)
        order = None
        if found and plan.timed and found[0].start > tube.times[0]:
            near = found[0].nearest
            tables = self.checker.tables
            order = stop_order((near.a, near.b), found[0].start, tube, tables)
        names = self.scene.q_names
        return PlanProof(
            source=plan.source,
            timed=plan.timed,
            start=float(tube.times[0]),
            end=float(tube.times[-1]),
            interpolation=plan.interpolation,
            following_error=float(
                figures_by_joint("following_error", following_error, names).max()
            ),
            skew=float(figures_by_joint("skew", skew, names).max()),
            resolution=resolution,
            intervals=tuple(found),
            planned=self._planned(found, tube, resolution),
            least=self._paver.least(tube),
            order=order,
            notes=plan.notes,
        )

    def certificate(self, plan: Plan) -> Certificate:
        """All tiles of the proof of a plan's curves, for `recheck`.

        Args:
            plan: The plan; nothing is off its curves.
        """
        tube = plan.tube
        paving = self._paver.pave(tube, RESOLUTION if plan.timed else ROW_RESOLUTION)
        tables = self.checker.tables
        return Certificate(
            scene=scene_hash(tables),
            q_names=tables.q_names,
            times=tube.times,
            control=tube.control,
            links=tuple(self._paver.links.names),
            tiles=paving.tiles,
            open=paving.open,
            pairs=paving.pairs,
            leaves=paving.leaves[
                :, [PAIR, PLACE, PLACE + LOW, PLACE + HIGH, LABEL, LOWER]
            ],
        )

    def _intervals(self, tube: Tube, resolution: float) -> list[NearInterval]:
        """What is not proven of a tube."""
        paving = self._paver.pave(tube, resolution)
        return self._paver.intervals(paving, tube, resolution)

    def _planned(
        self, found: list[NearInterval], tube: Tube, resolution: float
    ) -> tuple[bool, ...]:
        """Whether each interval is there without any width of the tube."""
        if not found or not tube.wide.any():
            return (True,) * len(found)
        alone = tube.without_width()
        curves = self._intervals(alone, resolution)
        return tuple(
            any(
                (other.nearest.a, other.nearest.b) == (one.nearest.a, one.nearest.b)
                and other.start <= one.end
                and other.end >= one.start
                for other in curves
            )
            for one in found
        )


def verify(
    plan: Plan | Trajectory | str | Path,
    scene: Scene,
    *,
    interpolation: Interpolation | None = None,
    following_error: ByName = 0.0,
    skew: ByName = 0.0,
    start: ArrayLike | None = None,
) -> PlanProof:
    """Prove a plan in a scene; a `PlanVerifier` is faster for several.

    Args:
        plan: The plan, or what `Plan.read` or `Plan.of` makes one of.
        scene: The scene.
        interpolation: See `Plan.of`.
        following_error: See `PlanVerifier.verify` [rad or m].
        skew: See `PlanVerifier.verify` [s].
        start: See `Plan.of` [rad or m].

    Raises:
        TrajectoryError: It is no plan of this scene.
        SceneError: The scene contradicts itself.

    Example:
        >>> import numpy as np
        >>> import armguard as ag
        >>> scene = ag.bay_scene()
        >>> rows = np.array([scene.home, scene.home + 0.01])
        >>> motion = ag.Trajectory(scene.q_names, rows, None, "a line")
        >>> print(ag.verify(motion, scene).sentence.splitlines()[0])
        a line: OK, every pair keeps its buffer all the way, proven
    """
    if isinstance(plan, Trajectory):
        plan = Plan.of(plan, scene, interpolation=interpolation, start=start)
    elif not isinstance(plan, Plan):
        plan = Plan.read(plan, scene, interpolation=interpolation, start=start)
    return PlanVerifier(scene).verify(plan, following_error=following_error, skew=skew)
