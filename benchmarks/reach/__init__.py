"""Operators with goals: how many are reached, with each response and with a peer."""
