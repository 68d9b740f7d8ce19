"""What a client is told when it says hello."""

import json
from collections.abc import Iterable
from typing import Any

from armguard.guard.levels import SENTENCES, Level
from armguard.scene.tables import SceneTables
from armguard.station.service.settings import ServiceSettings
from armguard.station.wire.boot import boot_id
from armguard.station.wire.layout import PART, VERSION, WELCOME, Kind
from armguard.station.wire.outbox import Outbox


def tools_of(tables: SceneTables) -> tuple[str, ...]:
    """Names of tools in the order of their indices: robots, then links."""
    return (*(part.name for part in tables.robots), *tables.links)


def welcome_text(
    tables: SceneTables,
    settings: ServiceSettings,
    bodies: Iterable[str],
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
            "bodies": list(bodies),
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


def parts_of(text: bytes) -> list[bytes]:
    """A text in parts that each fit into a message."""
    return [text[at : at + PART] for at in range(0, len(text), PART)]


def welcome_part(
    outbox: Outbox,
    tables: SceneTables,
    parts: list[bytes],
    k: int,
    asked: int,
    received: int,
) -> memoryview:
    """The message with the k-th part.

    Args:
        outbox: Where messages of the service are written.
        tables: The scene.
        parts: All parts.
        k: Which one.
        asked: Stamp of the HELLO it answers [ns].
        received: When that came in, monotonic [ns].
    """
    payload = outbox.payload
    WELCOME.pack_into(
        payload,
        0,
        k,
        len(parts),
        len(tables.q_names),
        len(tables.robots),
        tables.period,
        asked,
        received,
    )
    end = WELCOME.size + len(parts[k])
    payload[WELCOME.size : end] = parts[k]
    return outbox.seal(Kind.WELCOME, end)
