"""What a first start says while it compiles."""

import pytest

from armguard.respond import compiling

SENTENCES = {
    # Files there are, there were, there will be; seconds.
    (0, 0, 100, 10.0): "compiling kernels: 0 %",
    (40, 40, 100, 10.0): "compiling kernels: 40 %",
    (25, 0, 100, 10.0): "compiling kernels: 25 %, about 30 s left",
    (60, 40, 100, 10.0): "compiling kernels: 60 %, about 20 s left",
    # There are more than was thought.
    (120, 0, 100, 99.0): "compiling kernels: 99 %, about 1 s left",
}


@pytest.mark.parametrize("given", SENTENCES)
def test_what_is_left_follows_from_what_was_done(given):
    assert compiling.time_left(*given) == SENTENCES[given]


def test_it_is_said_now_and_then(monkeypatch):
    clock = iter([0.0, 0.5, 11.0, 12.0, 22.0])
    monkeypatch.setattr(compiling, "monotonic", lambda: next(clock))
    files = iter([0, 10, 40])
    monkeypatch.setattr(compiling, "count_files", lambda: next(files))
    said = []
    left = compiling.TimeLeft(said.append, 110)
    for _ in range(4):
        left.on_end(None)
    assert said == [
        "compiling kernels: 9 %, about 110 s left",
        "compiling kernels: 36 %, about 38 s left",
    ]
