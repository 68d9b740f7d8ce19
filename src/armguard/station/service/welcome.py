"""Description of the service for a client that says hello."""

import json
from collections.abc import Iterator
from typing import Any

from armguard.guard.levels import SENTENCES, Level
from armguard.scene.tables import SceneTables
from armguard.station.desk.making import bodies_of
from armguard.station.service.context import Context
from armguard.station.service.judge import tools_of
from armguard.station.service.peers import Peer
from armguard.station.service.settings import ServiceSettings
from armguard.station.wire import Kind
from armguard.station.wire.boot import boot_id
from armguard.station.wire.layout import PART, VERSION, WELCOME

WATCHDOGS = ("wish", "commander", "controller")


def welcome_parts(
    tables: SceneTables, settings: ServiceSettings, **more: Any
) -> Iterator[bytes]:
    """Parts of the JSON of a WELCOME, each of which fits into a message.

    Home is in the first part.
    """
    watchdogs = {name: getattr(settings, f"{name}_watchdog") for name in WATCHDOGS}
    robots = [
        {"name": part.name, "first": part.first_joint, "count": part.joint_count}
        for part in tables.robots
    ]
    reasons = {str(int(k)): [k.name, sentence] for k, sentence in SENTENCES.items()}
    text = {
        "home": tables.home.tolist(),
        "names": list(tables.q_names),
        "robots": robots,
        "period": tables.period,
        "late": tables.late,
        "stale": settings.stale,
        "bodies": list(bodies_of(tables)),
        "tools": list(tools_of(tables)),
        "watchdogs": {
            **watchdogs,
            "forget": settings.forget,
            "heartbeat": settings.heartbeat,
        },
        "levels": {str(int(level)): level.name for level in Level},
        "reasons": reasons,
        "boot_id": boot_id(),
        "protocol": VERSION,
        **more,
    }
    data = json.dumps(text).encode()
    for at in range(0, len(data), PART):
        yield data[at : at + PART]


def send_welcome(context: Context, peer: Peer, asked: int, received: int) -> None:
    """Send a client all parts.

    Args:
        context: State that all parts of the loop share.
        peer: The client.
        asked: Stamp of the HELLO it answers [ns].
        received: When that was received, monotonic [ns].
    """
    tables, parts = context.judge.guard.guard.tables, context.welcome
    scene = len(tables.q_names), len(tables.robots), tables.period
    for k, part in enumerate(parts):
        head = WELCOME.pack(k, len(parts), *scene, asked, received)
        context.send(context.outbox.message(Kind.WELCOME, head, part), peer)
