"""Mistakes of users at each door, and what the answer holds: value, place, remedy."""
