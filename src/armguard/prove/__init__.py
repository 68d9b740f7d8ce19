"""Proofs over all configurations: which links never, or always, touch or trip zones."""

from armguard.prove.audit import RowAudit, audit_scene, audit_srdf
from armguard.prove.pair_proof import Budget, PairProof
from armguard.prove.pairs import prove_pairs
from armguard.prove.zones import ZoneProofs, prove_zones

__all__ = [
    "Budget",
    "PairProof",
    "RowAudit",
    "ZoneProofs",
    "audit_scene",
    "audit_srdf",
    "prove_pairs",
    "prove_zones",
]
