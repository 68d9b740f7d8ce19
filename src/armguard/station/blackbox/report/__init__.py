"""Reports: one page about a recording, with its near pairs, stops and cycle times."""

from armguard.station.blackbox.report.findings import Findings, findings_of, gather
from armguard.station.blackbox.report.incidents import Closeness
from armguard.station.blackbox.report.page import page, write_page

__all__ = ["Closeness", "Findings", "findings_of", "gather", "page", "write_page"]
