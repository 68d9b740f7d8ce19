"""Rows from the attacks on recordings, inputs, the browser's door and Zenoh."""

from collections.abc import Iterator, Mapping
from typing import Any

from attack.row import Row, none

# Greatest memory and time that a file may take [MB], [s].
MEMORY, TIME = 1024.0, 20.0


def recordings(count: int, seed: int) -> list[Row]:
    """Checkpoints and whole recordings with right checksums, changed at random."""
    from attack import recordings as made

    return [
        mutants(
            "recording", f"{kind} of recordings, changed, with right checksums", found
        )
        for kind, found in made.run(count, seed).items()
    ]


def inputs(count: int, seed: int) -> list[Row]:
    """Scenes, robots, meshes, keys and archives that are none, or much too large."""
    from attack import inputs as made

    found = made.run(count, seed)
    ended = {**found, "grown_mb": found["peak_MB"]}
    ended["signals"] += found["no_memory"]
    attack = "scenes, robots, meshes and recordings: bombs, then mutants of good files"
    return [mutants("files", attack, ended)]


def mutants(door: str, attack: str, found: Mapping[str, Any]) -> Row:
    """A row of files that were opened."""
    had = found["signals"] + found["tracebacks"]
    memory, time = found["grown_mb"], found["longest_s"]
    return Row(
        door=door,
        attack=attack,
        tried=found["tried"],
        had=had,
        unit="signals and tracebacks",
        target=f"0, at most {MEMORY:.0f} MB and {TIME:.0f} s each",
        passed=had == 0 and memory <= MEMORY and time <= TIME,
        note=f"at most {memory:.0f} MB and {time:.1f} s",
        figures=dict(found),
    )


def browser(raw: int, sockets: int) -> list[Row]:
    """Messages sent with or right after a handshake, and pages of other origins."""
    from attack import browser as made

    found = made.run(raw, sockets)
    names = {
        "raw": "messages sent with the handshake, from other origins and without "
        "the cookie",
        "chromium": "sockets that pages of other origins open in Chromium",
    }
    rows = []
    for kind, attack in names.items():
        one = found[kind]
        executed = sum(one["done"].values()) + (one["moved_rad"] > 0.0)
        learnt = one.get("ports_told_from_closed_ones", 0)
        rows.append(
            none(
                "browser",
                attack,
                one["tries"],
                executed + one["opened"] + learnt,
                unit="opened, executed or learnt",
                **one,
            )
        )
    return rows


def zenoh(count: int) -> list[Row]:
    """Messages that are forged, replayed and moved, as peer, client and by a router."""
    from attack import zenoh_bus as made

    return [
        row
        for mode, found in made.run(count).items()
        for row in over_zenoh(mode, found)
    ]


def over_zenoh(mode: str, found: Mapping[str, int]) -> Iterator[Row]:
    """Rows of one mode."""
    for attack, tried, had, unit in (
        ("commands", "forged_commands", "forged_commands_obeyed", "obeyed"),
        ("desires and states", "forged_wishes", "forged_wishes_accepted", "accepted"),
        ("claims with force", "claims", "claims_granted", "granted"),
    ):
        name = f"{attack} forged over Zenoh, {mode}"
        yield none("zenoh", name, found[tried], found[had], unit=unit)
    name = f"tokens overheard over Zenoh, {mode}"
    tried, had = found["claims"], found["tokens_overheard"]
    yield none("zenoh", name, tried, had, unit="overheard", **found)
