"""Why a robot does not follow: each reason has a sentence, here and in the docs."""

from pathlib import Path

import pytest

from armguard.respond import Blocked

PAGE = (Path(__file__).parents[2] / "docs" / "filter.md").read_text("utf-8")


@pytest.mark.parametrize("why", Blocked)
def test_each_has_a_sentence_and_a_row(why):
    assert len(why.sentence) > 8
    assert f"| `{why.name}` |" in PAGE
