"""Campaigns of many episodes, each drawn from its seed: run and recorded."""
