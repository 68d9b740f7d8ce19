"""Fleets: audits, proofs, replays and closed loops, on as many cores as there are.

It needs the packages of `armguard[fleet]`.
"""
