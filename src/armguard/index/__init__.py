"""Broad phase: which primitives are near each other."""
