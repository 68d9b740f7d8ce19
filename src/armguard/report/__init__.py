"""Reports: one page about a recording, with its near pairs, stops and cycle times."""

from armguard.report.findings import Findings, findings_of, gather
from armguard.report.incidents import Closeness
from armguard.report.page import page, write_page

__all__ = ["Closeness", "Findings", "findings_of", "gather", "page", "write_page"]
