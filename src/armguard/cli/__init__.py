"""The command line: `armguard demo | check | run | octree | bench`."""

from armguard.cli.app import main

__all__ = ["main"]
