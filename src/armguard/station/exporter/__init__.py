"""Figures of a running service for Prometheus, read from what the loop writes down."""

from armguard.station.exporter.collector import ServiceCollector
from armguard.station.exporter.page import Page

__all__ = ["Page", "ServiceCollector"]
