"""Nothing of what strangers send is done, by raw sockets or from pages of theirs."""

import pytest

from attack.browser import CHROMIUM, run


def test_nothing_that_pages_of_others_send_is_done():
    if not CHROMIUM.exists():
        pytest.skip(f"there is no browser at {CHROMIUM}")
    pytest.importorskip("playwright.sync_api")
    found = run(raw=200, sockets=16)
    assert found["raw"] == {
        "tries": 200,
        "answered": 0,
        "opened": 0,
        "done": {},
        "moved_rad": 0.0,
    }
    assert found["chromium"] == {
        "tries": 16,
        "opened": 0,
        "ports_told_from_closed_ones": 0,
        "done": {},
        "moved_rad": 0.0,
    }
