"""Attacks on a station from outside, each against real processes."""
