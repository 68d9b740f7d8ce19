"""Mutants of the deciding code, compiled at once and chosen by a switch in memory."""
