"""Edge: the guard as a process of its own, what it is shown on and what remembers it.

One process runs the loop and nothing else. It writes every cycle into a ring in shared
memory; recorder, view and exporters are processes of their own that read the ring, and
whatever happens to them costs the loop nothing.
"""
