"""Fleets: audits, proofs and replays of many recordings, on as many cores as there are.

It needs the packages of `armguard[fleet]`.
"""
