"""Operators with goals: who gets there, with each response and with a peer."""
