"""Proofs kept on disk, by what they were made of."""

import json
import os
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.kernel import KERNEL_CACHE, PACKAGE, cache_home
from armguard.prove.pair_proof import Budget, PairProof
from armguard.prove.pair_tables import PairTables
from armguard.robot.fitting.store import as_dict, fit_key
from armguard.robot.model import FittedLink, Link

Floats = NDArray[np.float64]


def proof_key(tables: PairTables, prints: Sequence[str]) -> str:
    """Hash of all a proof depends on: joints, limits, shapes, and this code.

    Args:
        tables: The two links.
        prints: Their prints.
    """
    # The folder of compiled kernels is named by the hash of every kernel.
    digest = sha256(KERNEL_CACHE.name.encode())
    for source in sorted((PACKAGE / "prove").glob("*.py")):
        digest.update(source.read_bytes())
    digest.update(repr(tables.joints).encode())
    for numbers in (tables.lower, tables.upper, *tables.kinematics.values()):
        digest.update(numbers.tobytes())
    digest.update(repr(tuple(prints)).encode())
    return digest.hexdigest()[:32]


def link_print(link: Link, fit: FittedLink, T_body_link: Floats) -> str:
    """Hash of a link's geometry, its mesh files and its shapes.

    Args:
        link: The link.
        fit: Its shapes.
        T_body_link: Its frame in its body, shape (4, 4).
    """
    digest = sha256(fit_key(link, ()).encode())
    digest.update(T_body_link.tobytes())
    shapes = [[as_dict(s) for s in union] for union in (fit.exact, fit.shapes)]
    digest.update(json.dumps(shapes).encode())
    return digest.hexdigest()


def path_of(key: str) -> Path:
    """File of a proof."""
    return cache_home() / "proofs" / f"{key}.json"


def read_proof(key: str, budget: Budget) -> PairProof | None:
    """A kept proof; None if there is none, or an open one that cost less than asked.

    Args:
        key: Of the proof.
        budget: What one may cost now.
    """
    try:
        held = json.loads(path_of(key).read_text(encoding="utf-8"))
        proof = PairProof(**held["proof"])
        spent = Budget(**held["budget"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    enough = spent.seconds >= budget.seconds and spent.boxes >= budget.boxes
    return proof if proof.verdict != "open" or enough else None


def write_proof(key: str, proof: PairProof, budget: Budget) -> None:
    """Keep a proof; a cache that cannot be written is no reason to stop."""
    path = path_of(key)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump({"proof": asdict(proof), "budget": asdict(budget)}, file)
        Path(name).replace(path)
    except OSError:
        return
