"""`bench batch`: rates of the checker beside its peers, by scene.

Random rows, and rows along clear motions of 0.5 rad about home, 64 each. Times are
nanoseconds a row, or a motion, the best of ten rounds. Peers judge one configuration a
call and prove nothing.
"""

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import armguard as ag
from armguard.scene import Scene, SceneTables, load_scene, two_pandas_scene
from armguard.scene.compile import compile_scene
from arrays import Floats
from batch_rates import Calls, best_times, clear_motions, ring_scene
from peers import MODULES, NOT_INSTALLED, Peer
from timing import Progress, quiet

# Random rows.
CYCLES = 20_000

# Random rows of the peers.
PEER_ROWS = 500

# Distances from here on are not looked for [m].
MARGIN = 0.1

THREADS = (1, 2)

ROUNDS = 10


def bench(cycles: int, progress: Progress, scene: Path | None = None) -> dict[str, Any]:
    """Times by scene, by threads and kind of row.

    Args:
        cycles: Random rows.
        progress: Called with a sentence before each scene.
        scene: Scene file; the bundled scenes if None.
    """
    if scene is None:
        scenes = {
            "bay": ag.bay_scene(),
            "two Pandas": two_pandas_scene(),
            "Panda, 14 balls, 21 boxes": ring_scene("panda", 14, 21),
        }
    else:
        scenes = {scene.name: load_scene(scene)}
    found = {}
    for name, one in scenes.items():
        progress(f"{name}: measuring")
        found[name] = figures_of(one, cycles)
    return {"nanoseconds": found}


def figures_of(scene: Scene, count: int) -> dict[str, Any]:
    """Times of one scene [ns]."""
    tables = compile_scene(scene)
    rng, joints = np.random.default_rng(1), len(tables.lower)
    q = rng.uniform(tables.lower, tables.upper, (count, joints))
    along = clear_motions(ag.Checker(tables), tables.home)
    found: dict[str, Any] = {"pairs": tables.checkable_pairs}
    for threads in THREADS:
        checker = ag.Checker(tables, threads)
        kinds = {"random rows": calls_of(checker, q)}
        if len(along):
            ways = along.reshape(-1, 64, joints)
            kinds["about home"] = calls_of(checker, along)
            kinds["about home"] |= proof_of(checker, ways[:, 0], ways[:, -1])
        label = "1 thread" if threads == 1 else f"{threads} threads"
        found[label] = {kind: timed(calls, threads) for kind, calls in kinds.items()}
    return found | peers_of(tables, q[:PEER_ROWS])


def calls_of(checker: ag.Checker, q: Floats) -> Calls:
    """The calls for some rows, and how many these are."""
    return {
        "clear": (lambda: checker.clear(q), len(q)),
        "distances": (lambda: checker.distances(q), len(q)),
        f"distances to {MARGIN} m": (lambda: checker.distances(q, MARGIN), len(q)),
    }


def proof_of(checker: ag.Checker, starts: Floats, ends: Floats) -> Calls:
    """The proof of some motions, and how many these are."""
    return {"prove, a motion": (lambda: checker.prove(starts, ends), len(starts))}


def timed(calls: Calls, threads: int) -> dict[str, float]:
    """Times of calls [ns]; several threads may not share the one core of `quiet`."""
    if threads > 1:
        return best_times(calls, ROUNDS)
    with quiet():
        return best_times(calls, ROUNDS)


def peers_of(tables: SceneTables, q: Floats) -> dict[str, Any]:
    """Times of the peers in random rows [ns], and why others are not there."""
    calls: Calls = {}
    absent = []
    for packages, module in MODULES.items():
        try:
            peers: list[Peer] = [
                kind(tables) for kind in import_module(f"peers.{module}").PEERS
            ]
        except ImportError:
            absent.append(f"{packages}: {NOT_INSTALLED}")
        except ValueError as error:
            absent.append(f"{packages}: {error}")
        else:
            for peer in peers:
                own = peer.positions(q)
                calls[peer.name] = (
                    lambda step=peer.step, own=own: [step(row) for row in own],
                    len(q),
                )
    return {"peers": timed(calls, 1), "absent": absent}
