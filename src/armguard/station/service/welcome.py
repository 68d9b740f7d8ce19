"""What a client is told when it says hello."""

import json
from typing import Any

from armguard.guard.levels import SENTENCES, Level
from armguard.scene.tables import SceneTables
from armguard.station.desk.making import bodies_of
from armguard.station.service.hub import Hub
from armguard.station.service.judge import tools_of
from armguard.station.service.peers import Peer
from armguard.station.service.settings import ServiceSettings
from armguard.station.wire.boot import boot_id
from armguard.station.wire.layout import PART, VERSION, WELCOME, Kind


def welcome_text(
    tables: SceneTables,
    settings: ServiceSettings,
    **more: Any,
) -> bytes:
    """The JSON of a WELCOME; home comes first, so that it is in the first part."""
    return json.dumps(
        {
            "home": tables.home.tolist(),
            "names": list(tables.q_names),
            "robots": [
                {
                    "name": part.name,
                    "first": part.first_joint,
                    "count": part.joint_count,
                }
                for part in tables.robots
            ],
            "period": tables.period,
            "late": tables.late,
            "stale": settings.stale,
            "bodies": list(bodies_of(tables)),
            "tools": list(tools_of(tables)),
            "watchdogs": {
                "wish": settings.wish_watchdog,
                "commander": settings.commander_watchdog,
                "controller": settings.controller_watchdog,
                "forget": settings.forget,
                "heartbeat": settings.heartbeat,
            },
            "levels": {str(int(level)): level.name for level in Level},
            "reasons": {
                str(int(reason)): [reason.name, sentence]
                for reason, sentence in SENTENCES.items()
            },
            "boot_id": boot_id(),
            "protocol": VERSION,
            **more,
        }
    ).encode()


class Welcome:
    """Tells what is guarded, in parts that each fit into a message."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def adopt(self, text: bytes) -> None:
        """Tell that from now on."""
        self._parts = [text[at : at + PART] for at in range(0, len(text), PART)]

    def send(self, hub: Hub, peer: Peer, asked: int, received: int) -> None:
        """Tell somebody all of it.

        Args:
            hub: What all parts of the loop share.
            peer: Who.
            asked: Stamp of the HELLO it answers [ns].
            received: When that came in, monotonic [ns].
        """
        tables, outbox = hub.judge.guard.guard.tables, hub.outbox
        payload = outbox.payload
        for k, part in enumerate(self._parts):
            WELCOME.pack_into(
                payload,
                0,
                k,
                len(self._parts),
                len(tables.q_names),
                len(tables.robots),
                tables.period,
                asked,
                received,
            )
            end = WELCOME.size + len(part)
            payload[WELCOME.size : end] = part
            hub.send(outbox.seal(Kind.WELCOME, end), peer)
