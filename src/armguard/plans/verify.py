"""Proofs over whole plans in a scene."""

from collections.abc import Collection, Iterable, Sequence
from math import inf
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from armguard.batch.checker import Checker
from armguard.errors import TrajectoryError, UnknownNameError, did_you_mean
from armguard.plans.certificate import Certificate, scene_hash
from armguard.plans.pieces import Piece
from armguard.plans.plan import ByName, Plan, figures_by_joint
from armguard.plans.proof import PlanProof
from armguard.plans.splines import Interpolation
from armguard.plans.stop_order import stop_order
from armguard.plans.sweep import meeting, sweep
from armguard.prove.paving import NearInterval, Paver
from armguard.prove.tile_search import LABEL, LOWER, PAIR, PLACE
from armguard.prove.tube import Tube
from armguard.prove.tube_tiles import HIGH, LOW
from armguard.scene import Scene, Trajectory
from armguard.scene.compile import compile_scene
from armguard.scene.restricted import restricted
from armguard.scene.standing import object_named
from armguard.scene.tables import SceneTables

# Ends of intervals are this exact: in time [s], and without time in rows [-].
RESOLUTION = 5e-5
ROW_RESOLUTION = 1e-3


class PlanVerifier:
    """Proves plans in the world of one scene.

    Attributes:
        scene: The scene.
        checker: A checker of it; `place` and `remove` change the world.
        moved: Objects to whose pairs the proofs are limited; empty for all pairs.

    Args:
        scene: The scene.
        moved: Objects that moved since the plans were proven. The pairs of these are
            proven again, which is faster; all others are taken to hold as before.

    Raises:
        SceneError: The scene contradicts itself.
        UnknownNameError: An object of `moved` is not in the scene.

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

    def __init__(self, scene: Scene, *, moved: Sequence[str] = ()) -> None:
        self.scene, self.moved = scene, tuple(moved)
        tables = compile_scene(scene)
        self.checker = Checker(only_pairs_of(self.moved, tables) if moved else tables)
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
            moved=self.moved,
        )

    def certificate(self, plan: Plan) -> Certificate:
        """All tiles of the proof of a plan's curves, for `recheck`.

        Args:
            plan: The plan; nothing is off its curves.

        Raises:
            TrajectoryError: The proofs are limited to objects that moved.
        """
        if self.moved:
            raise TrajectoryError(
                "a certificate is of all pairs; prove the plan without moved objects"
            )
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

    def sweep(
        self,
        plan: Plan,
        *,
        following_error: ByName = 0.0,
        skew: ByName = 0.0,
        tolerance: float = 0.005,
        links: Collection[str] | None = None,
        relative_to: str | None = None,
    ) -> list[Piece]:
        """Convex pieces that together hold all that links pass through.

        Args:
            plan: The plan.
            following_error: See `verify` [rad or m].
            skew: See `verify` [s].
            tolerance: How far pieces may reach beyond that, about; less makes more of
                them [m].
            links: 'robot/link' of those that are swept; all that move if left out.
            relative_to: 'robot/link' in whose frame they are swept; the world if left
                out. By default only links that are checked against it are swept then.

        Raises:
            TrajectoryError: A figure is no such figure, or a name is unknown.
            UnknownNameError: A link is none of a robot in the scene.
        """
        tables = self.checker.tables
        for link in links or ():
            self._check_link(link)
        if relative_to is not None:
            self._check_link(relative_to)
            links = self._checked_against(relative_to) if links is None else links
        tube = plan.widened(self.scene, following_error, skew)
        found = sweep(
            tube, tables, tolerance=tolerance, links=links, relative_to=relative_to
        )
        return list(found)

    def meeting(self, pieces: Iterable[Piece], link: str) -> list[Piece]:
        """The pieces of a sweep relative to a link that the link may meet.

        A swept link that no piece of has a point in common with this one never touches
        it, even where both pass the same place at different times.

        Args:
            pieces: Pieces in the frame of the link, see `sweep`.
            link: 'robot/link'.

        Raises:
            TrajectoryError: The link has no shape, or one that only a function
                describes.
            UnknownNameError: It is none of a robot in the scene.
        """
        self._check_link(link)
        return meeting(pieces, link, self.checker.tables)

    def _check_link(self, link: str) -> None:
        """Refuse a name that is no link's."""
        links = self.checker.tables.links
        if link not in links:
            raise UnknownNameError(
                f"no link is named '{link}'; {did_you_mean(link, links)}"
            )

    def _checked_against(self, link: str) -> set[str]:
        """Links and objects that are checked against a link."""
        if self.moved:
            raise TrajectoryError(
                "a relative sweep is of all pairs; leave out the moved objects"
            )
        t = self.checker.tables
        names = np.array(t.body_names)
        own = np.unique(t.groups[names == link])
        return set(names[t.checked[own][:, t.groups].any(axis=0)].tolist())

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


def only_pairs_of(names: Sequence[str], tables: SceneTables) -> SceneTables:
    """Tables in which only the pairs of some objects are checked.

    Raises:
        UnknownNameError: One is no object that is attached to no link.
    """
    own = np.zeros(len(tables.groups), dtype=np.intp)
    for name in names:
        item = object_named(name, tables.standing)
        own[item.first : item.first + item.count] = 1
    return restricted(tables, own, lambda a, b: a + b > 0)


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
