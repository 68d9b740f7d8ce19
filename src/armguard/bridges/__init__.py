"""Bridges: the guard's service to other protocols, each a process of its own."""
