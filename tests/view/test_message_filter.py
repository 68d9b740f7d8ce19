"""Only what our page sends gets through to viser; the rest costs a line a second."""

import asyncio
import logging

import msgspec
import pytest

from armguard.view.viser_server import PAUSE, DropLog, FilteredConnection

TURN = {"wxyz": [1, 0, 0, 0], "position": [0.5, 0.4, 0.7], "owner": ""}
DRAG = {"type": "TransformControlsUpdateMessage", "name": "/handles/left", **TURN}
CLICK = {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": True}}


def packed(message):
    return msgspec.msgpack.encode(message)


OURS = [packed(DRAG), packed(CLICK), packed({**CLICK, "updates": {"value": [1, 2.5]}})]

NOT_OURS = {
    "text": "stop",
    "nothing": b"",
    "noise": b"\xc1\xff\x00",
    "deep": b"\x91" * 60_000 + b"\x01",
    "list": packed([DRAG]),
    "no type": packed(TURN),
    "number as type": packed({**DRAG, "type": 3}),
    "tunnel": packed({"type": "ShareUrlRequest"}),
    "upload": packed({"type": "FileTransferStartUpload", "source_component_uuid": "a"}),
    "short": packed({**DRAG, "position": [0.5]}),
    "words": packed({**DRAG, "position": ["a", "b", "c"]}),
    "NaN": packed({**DRAG, "position": [float("nan"), 0.0, 0.0]}),
    "infinite": packed({**DRAG, "position": [float("inf"), 0.0, 0.0]}),
    "no rotation": packed({**DRAG, "wxyz": [0, 0, 0, 0]}),
    "other attribute": packed({**CLICK, "updates": {"removed": True}}),
    "attribute beside it": packed({**CLICK, "updates": {"value": 1, "label": "x"}}),
    "value of NaN": packed({**CLICK, "updates": {"value": float("nan")}}),
    "value that is an object": packed({**CLICK, "updates": {"value": {"a": 1}}}),
    "nested value": packed({**CLICK, "updates": {"value": [[1]]}}),
}


class Sent:
    """A connection on which some messages come in."""

    def __init__(self, *messages):
        self.messages = list(messages)

    async def recv(self):
        return self.messages.pop(0)


@pytest.mark.parametrize("name", NOT_OURS)
def test_what_is_not_ours_is_dropped_and_the_next_message_is_heard(name):
    drops = DropLog()
    for ours in OURS:
        filtered = FilteredConnection(Sent(NOT_OURS[name], ours), drops)
        assert asyncio.run(filtered.recv()) == ours


def test_drops_cost_one_line_a_second(caplog):
    now = 0.0
    drops = DropLog(lambda: now)
    with caplog.at_level(logging.WARNING, logger="armguard.view"):
        for _ in range(100):
            drops.add("noise")
        assert len(caplog.records) == 1
        now = PAUSE
        drops.add("noise")
    assert caplog.messages[-1] == "dropped 100 messages of pages: noise"
