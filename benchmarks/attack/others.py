"""Rows from the attacks on recordings, inputs, the browser's door and Zenoh."""

from collections.abc import Mapping
from typing import Any

from attack.row import Row, none

# Greatest memory and time that a file may take [MB], [s].
MEMORY, TIME = 1024.0, 20.0


def recordings(count: int, seed: int) -> list[Row]:
    """Checkpoints and whole recordings with right checksums, changed at random."""
    from attack.recordings import run

    words = "of recordings, changed, with right checksums"
    found = run(count, seed)
    return [mutants("recording", f"{kind} {words}", found[kind]) for kind in found]


def inputs(count: int, seed: int) -> list[Row]:
    """Scenes, robots, meshes, keys and archives that are none, or much too large."""
    from attack.inputs import run

    found = run(count, seed)
    ended = {**found, "grown_mb": found["peak_MB"]}
    ended["signals"] += found["no_memory"]
    attack = "scenes, robots, meshes and recordings: bombs, then mutants of good files"
    return [mutants("files", attack, ended)]


def mutants(door: str, attack: str, found: Mapping[str, Any]) -> Row:
    """A row of files that were opened."""
    had = found["signals"] + found["tracebacks"]
    memory, time = found["grown_mb"], found["longest_s"]
    return Row(
        attack,
        found["tried"],
        had,
        "signals and tracebacks",
        f"0, at most {MEMORY:.0f} MB and {TIME:.0f} s each",
        had == 0 and memory <= MEMORY and time <= TIME,
        f"at most {memory:.0f} MB and {time:.1f} s",
        found,
        door=door,
    )


def browser(raw: int, sockets: int) -> list[Row]:
    """Messages sent with or right after a handshake, and pages of other origins."""
    from attack.browser import executed, run

    found = run(raw, sockets)
    rows = []
    for kind, attack in (
        (
            "raw",
            "messages sent with the handshake, from other origins and without "
            "the cookie",
        ),
        ("chromium", "sockets that pages of other origins open in Chromium"),
    ):
        one = found[kind]
        had = executed(one) + one["opened"] + one.get("ports_told_from_closed_ones", 0)
        unit = "opened, executed or learnt"
        rows.append(none(attack, one["tries"], had, unit, door="browser", **one))
    return rows


def zenoh(count: int) -> list[Row]:
    """Messages that are forged, replayed and moved, as peer, client and by a router."""
    from attack.zenoh_bus import run

    rows = []
    for mode, found in run(count).items():
        for attack, tried, had, unit in (
            ("commands forged", "forged_commands", "forged_commands_obeyed", "obeyed"),
            (
                "desires and states forged",
                "forged_wishes",
                "forged_wishes_accepted",
                "accepted",
            ),
            ("claims with force forged", "claims", "claims_granted", "granted"),
            ("tokens overheard", "claims", "tokens_overheard", "overheard"),
        ):
            more = found if attack == "tokens overheard" else {}
            name = f"{attack} over Zenoh, {mode}"
            rows.append(
                none(name, found[tried], found[had], unit, door="zenoh", **more)
            )
    return rows
