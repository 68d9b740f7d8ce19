"""Pairs of links of one robot, proven one beside the other within one budget."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from time import monotonic
from typing import NamedTuple

from armguard.errors import UnknownNameError, did_you_mean
from armguard.geometry.shapes import PlacedShape
from armguard.prove.pair_proof import (
    Budget,
    PairProof,
    not_looked_at,
    without_geometry,
)
from armguard.prove.pair_tables import SideShapes, pair_tables
from armguard.prove.search import PairSearch
from armguard.prove.store import link_print, proof_key, read_proof, write_proof
from armguard.prove.surface import surface_parts
from armguard.robot.kinematics import kinematic_table
from armguard.scene.meshes import Progress
from armguard.scene.scene import SceneRobot

# Time a pair gets in its first turn, and how much more in each further one [s], [-].
FIRST_TURN = 0.25
TURN_GROWTH = 4.0


def prove_pairs(
    robot: SceneRobot,
    pairs: Sequence[tuple[str, str]] | None = None,
    *,
    budget: Budget | None = None,
    progress: Progress | None = None,
) -> list[PairProof]:
    """Prove for pairs of links of one robot that they never, or always, touch.

    Every joint may stand anywhere within its limits, one without limits anywhere in a
    turn. A pair met easily is decided at once; the others take turns, each longer than
    the last. Proofs are kept on disk.

    Args:
        robot: The robot.
        pairs: Pairs of its links; all that have geometry if None.
        budget: What it may cost.
        progress: Called with the pair, its number and their count as pairs are decided.

    Returns:
        A proof for each pair, in their order.

    Raises:
        UnknownNameError: The robot has no such link.
    """
    if pairs is None:
        links = list(robot.fits)
        pairs = [(a, b) for k, a in enumerate(links) for b in links[k + 1 :]]
    check_links(robot, pairs)
    wanted = list(dict.fromkeys((min(pair), max(pair)) for pair in pairs))
    proofs = PairProofs(robot, len(wanted), budget or Budget(), progress)
    waiting = [search for pair in wanted if (search := proofs.begin(*pair)) is not None]
    turn = FIRST_TURN
    while waiting:
        waiting = [
            search
            for number, search in enumerate(waiting)
            if proofs.goes_on(search, turn, len(waiting) - number)
        ]
        turn *= TURN_GROWTH
    found = proofs.found
    return [
        replace(found[min(pair), max(pair)], link_a=pair[0], link_b=pair[1])
        for pair in pairs
    ]


class WaitingSearch(NamedTuple):
    """A pair that is not decided yet: its key on disk, and its search."""

    pair: tuple[str, str]
    key: str
    search: PairSearch


class PairProofs:
    """Proofs of pairs of one robot's links within one budget.

    Attributes:
        found: The proof of each decided pair.

    Args:
        robot: The robot.
        count: Count of pairs.
        budget: What they may cost together.
        progress: Called as pairs are decided.
    """

    def __init__(
        self, robot: SceneRobot, count: int, budget: Budget, progress: Progress | None
    ) -> None:
        self.found: dict[tuple[str, str], PairProof] = {}
        self._robot, self._count = robot, count
        self._budget, self._progress = budget, progress
        self._end = monotonic() + budget.seconds
        self._searched = False
        self._table = kinematic_table(robot.model)
        self._print = cache(self._link_print)
        self._surface = cache(self._surface_parts)

    def begin(self, a: str, b: str) -> WaitingSearch | None:
        """Decide a pair that needs no long search; else give its search a first turn.

        Returns:
            The search if it is not over.
        """
        fits, budget = self._robot.fits, self._budget
        if a not in fits or b not in fits:
            self._settle((a, b), without_geometry(a, b))
            return None
        sides = [SideShapes.of(fits[link]) for link in (a, b)]
        tables = pair_tables(self._robot.model, self._table, *sides)
        key = proof_key(tables, [self._print(link) for link in (a, b)])
        held = read_proof(key, budget)
        if held is not None:
            self._settle((a, b), held)
            return None
        if monotonic() > self._end:
            self._settle((a, b), not_looked_at(a, b))
            return None
        search = PairSearch(tables)
        if not self._searched:
            # The first search may have had to compile what all of them use.
            self._end = max(self._end, monotonic() + budget.seconds)
            self._searched = True
        if search.verdict == "sometimes":
            finer = [side.joined(self._surface(side.link)) for side in sides]
            if finer != sides:
                tables = pair_tables(self._robot.model, self._table, *finer)
                search = PairSearch(tables, solid=search)
        search.run(FIRST_TURN, budget.boxes)
        return WaitingSearch((a, b), key, search)

    def goes_on(self, waiting: WaitingSearch, turn: float, left: int) -> bool:
        """Give a search a turn; write and keep its proof if it is over then.

        Args:
            waiting: The search.
            turn: Longest time for it [s].
            left: Count of searches that share the time left, with this one.

        Returns:
            Whether it needs another turn.
        """
        pair, key, search = waiting
        budget = self._budget
        share = (self._end - monotonic()) / left
        search.run(min(turn, share), budget.boxes - search.boxes)
        spent = monotonic() >= self._end or search.boxes >= budget.boxes
        if not (search.is_over or spent):
            return True
        proof = search.proof(*pair)
        write_proof(key, proof, budget)
        self._settle(pair, proof)
        return False

    def _settle(self, pair: tuple[str, str], proof: PairProof) -> None:
        """Keep the proof of a pair, and report it."""
        self.found[pair] = proof
        if self._progress is not None:
            self._progress(f"{pair[0]}, {pair[1]}", len(self.found), self._count)

    def _link_print(self, link: str) -> str:
        """Hash of a link and its fit."""
        robot = self._robot
        T = self._table.T_body_link[link]
        return link_print(robot.model.links[link], robot.fits[link], T)

    def _surface_parts(self, link: str) -> tuple[PlacedShape, ...]:
        """Exact surface of a link, in parts."""
        return surface_parts(self._robot.model.links[link], self._robot.fits[link])


def check_links(robot: SceneRobot, pairs: Sequence[tuple[str, str]]) -> None:
    """A robot has the links of all pairs.

    Raises:
        UnknownNameError: It does not.
    """
    for name in (link for pair in pairs for link in pair):
        if name not in robot.model.links:
            raise UnknownNameError(
                f"robot '{robot.name}' has no link '{name}'; "
                f"{did_you_mean(name, robot.model.links)}"
            )
