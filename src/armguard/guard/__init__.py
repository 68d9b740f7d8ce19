"""Decide: the cycle from joint angles to verdict."""
