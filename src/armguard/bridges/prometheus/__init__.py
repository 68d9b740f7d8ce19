"""Figures of a running service for Prometheus, read from what the loop writes down."""
