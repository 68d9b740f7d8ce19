"""One page about a recording: what was near, what stopped, how fast it was judged."""

from armguard.station.blackbox.report.findings import Findings, findings_of, gather
from armguard.station.blackbox.report.near_misses import Closeness
from armguard.station.blackbox.report.page import page, write_page

__all__ = ["Closeness", "Findings", "findings_of", "gather", "page", "write_page"]
