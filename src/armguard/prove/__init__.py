"""Proofs over all configurations: which pairs of links can never, or always, touch."""

from armguard.prove.audit import RowAudit, audit_scene, audit_srdf
from armguard.prove.pair_proof import Budget, PairProof
from armguard.prove.pairs import prove_pairs

__all__ = [
    "Budget",
    "PairProof",
    "RowAudit",
    "audit_scene",
    "audit_srdf",
    "prove_pairs",
]
