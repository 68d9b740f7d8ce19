"""Faults beside a running reflex, and how long it takes until the arms have to stop."""
