"""Pairs of links of one robot, proven one beside the other within one budget."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from time import monotonic

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
    budget = Budget() if budget is None else budget
    end = monotonic() + budget.seconds
    if pairs is None:
        links = list(robot.fits)
        pairs = [(a, b) for k, a in enumerate(links) for b in links[k + 1 :]]
    check_links(robot, pairs)
    wanted = list(dict.fromkeys((min(pair), max(pair)) for pair in pairs))
    found: dict[tuple[str, str], PairProof] = {}
    waiting: list[tuple[tuple[str, str], str, PairSearch]] = []

    def settle(pair: tuple[str, str], proof: PairProof) -> None:
        found[pair] = proof
        if progress is not None:
            progress(f"{pair[0]}, {pair[1]}", len(found), len(wanted))

    table = kinematic_table(robot.model)

    @cache
    def prints(link: str) -> str:
        T = table.T_body_link[link]
        return link_print(robot.model.links[link], robot.fits[link], T)

    @cache
    def surface(link: str) -> tuple[PlacedShape, ...]:
        return surface_parts(robot.model.links[link], robot.fits[link])

    for pair in wanted:
        if pair[0] not in robot.fits or pair[1] not in robot.fits:
            settle(pair, without_geometry(*pair))
            continue
        sides = [SideShapes.of(robot.fits[link]) for link in pair]
        tables = pair_tables(robot.model, table, *sides)
        key = proof_key(tables, [prints(link) for link in pair])
        held = read_proof(key, budget)
        if held is not None:
            settle(pair, held)
        elif monotonic() > end:
            settle(pair, not_looked_at(*pair))
        else:
            search = PairSearch(tables)
            if not waiting:
                # The first search may have had to compile what all of them use.
                end = max(end, monotonic() + budget.seconds)
            if search.verdict == "sometimes":
                finer = [s.joined(surface(s.link)) for s in sides]
                if finer != sides:
                    tables = pair_tables(robot.model, table, *finer)
                    search = PairSearch(tables, solid=search)
            search.run(FIRST_TURN, budget.boxes)
            waiting.append((pair, key, search))
    turn = FIRST_TURN
    while waiting:
        still = []
        for number, (pair, key, search) in enumerate(waiting):
            share = (end - monotonic()) / (len(waiting) - number)
            search.run(min(turn, share), budget.boxes - search.boxes)
            spent = monotonic() >= end or search.boxes >= budget.boxes
            if search.is_over or spent:
                proof = search.proof(*pair)
                write_proof(key, proof, budget)
                settle(pair, proof)
            else:
                still.append((pair, key, search))
        waiting = still
        turn *= TURN_GROWTH
    return [
        replace(found[min(pair), max(pair)], link_a=pair[0], link_b=pair[1])
        for pair in pairs
    ]


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
