"""A view outlives its service: it goes grey, and finds the next one by itself."""

import json
import time

import pytest
from tests.view.conftest import (
    OPTIONS,
    SCENE,
    channel_of,
    let_in,
    shown,
)
from websockets.sync.client import connect

from armguard.simulation.stage import Stage

PATIENCE = 40.0


def heard(page, what):
    """The first state of which something is true."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        message = json.loads(page.recv(timeout=PATIENCE))
        if message["type"] == "state" and what(message):
            return message
    raise AssertionError("the page got no such state")


@pytest.fixture
def stage(tmp_path):
    file = tmp_path / "scene.yaml"
    file.write_text(SCENE, encoding="utf-8")
    with (tmp_path / "log").open("wb") as log:
        with Stage(str(file), *OPTIONS, log=log) as made:
            yield made


def test_a_service_that_was_killed_leaves_a_grey_page_until_there_is_another(stage):
    stage.start_service()
    stage.wait_for_service()
    stage.start_arms()
    with shown(stage.port) as (_, link):
        with connect(channel_of(link), additional_headers=let_in(link)) as page:
            heard(page, lambda message: message["grey"] == "")
            stage.crew["service"].kill()
            stage.crew["service"].wait()
            message = heard(page, lambda message: message["grey"] != "")
            assert "nothing new since" in message["grey"]
            stage.start_service()
            stage.wait_for_service()
            again = heard(page, lambda message: message["grey"] == "")
            assert again["age"] < 5.0
