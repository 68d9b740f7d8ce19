"""Indices of the integers that a guard carries from one cycle to the next."""

TOKEN = 0  # counts lists of candidates, so that `seen` needs no clearing
KEPT_COUNT = 1  # count of near pairs of the last valid cycle
FORCE = 2  # 1: no row of the last cycle may be kept
CYCLE = 3  # counts cycles
MEMORY = 4
