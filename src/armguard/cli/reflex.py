"""The reflex in `armguard check --reflex`: its thresholds and their proofs."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

from armguard.cli.claims import positions
from armguard.cli.console import progress_bar
from armguard.cli.finding import Finding
from armguard.errors import StationError
from armguard.prove import Budget, ZoneProofs, prove_zones
from armguard.scene.scene import Scene
from armguard.service.wire.pulses import settings_of, write_settings

# A sensor that sends nothing for so many of its periods is silent.
PERIODS = 2.0


def prove_reflex(scene: Scene, seconds: float) -> list[ZoneProofs]:
    """Prove which zones of the reflex's sensors no posture of their robot trips.

    Args:
        scene: The scene.
        seconds: Time for all proofs together [s].
    """
    reflex = scene.reflex
    if reflex is None:
        return []
    sensors = [scene.sensors[name] for name in reflex.sensors]
    total = sum(one.zones[0] * one.zones[1] for one in sensors)
    budget = Budget(seconds=seconds / len(sensors))
    found = []
    with progress_bar("proving zones", total) as advance:
        for one in sensors:
            assert one.on is not None
            robot = scene.robots[one.on.split("/", 1)[0]]
            found.append(
                prove_zones(robot, one, reflex.distance, budget=budget, decided=advance)
            )
    return found


def reflex_findings(
    scene: Scene, file: Path, proofs: list[ZoneProofs] | None
) -> Iterator[Finding]:
    """What is proven of the reflex, whose file is written; or whether it is there.

    Args:
        scene: The scene.
        file: The scene's file.
        proofs: What is proven; None to write nothing.
    """
    reflex = scene.reflex
    if reflex is None:
        if proofs is not None:
            remedy = "declare sensors, and `reflex: {sensors: [NAME]}`"
            yield Finding("reflex", "FAIL", "the scene declares no reflex", remedy)
        return
    path = file.parent / reflex.file
    if proofs is None:
        try:
            settings_of(path)
        except StationError as error:
            yield Finding("reflex", "WARN", str(error), keys=("reflex",))
        return
    blind = [one for one in proofs if len(one.masked) == one.count]
    for one in proofs:
        if one.masked:
            yield masked_finding(one)
    if blind:
        names = ", ".join(f"'{one.sensor}'" for one in blind)
        yield Finding(
            "reflex",
            "FAIL",
            f"every zone of {names} is masked, so {path.name} is not written",
            "mount the sensor elsewhere, or reduce `reflex.distance`",
            keys=("reflex",),
        )
        return
    write_settings(path, settings_from(scene, proofs))
    total = sum(one.count for one in proofs)
    masked = sum(len(one.masked) for one in proofs)
    yield Finding(
        "reflex",
        "PASS",
        f"wrote {path.name}: {len(proofs)} sensors, {total} zones with a threshold of "
        f"{reflex.distance * 1e3:g} mm; no posture of the robot trips "
        f"{total - masked} of them, {masked} are masked",
    )


def masked_finding(proof: ZoneProofs) -> Finding:
    """The line about a sensor with masked zones."""
    says = [
        f"zones {ranges(zones)} ({link} {seen(proof, zones[0])})"
        for link, zones in by_link(proof).items()
    ]
    return Finding(
        "zones",
        "WARN",
        f"{len(proof.masked)} of {proof.count} zones are masked: {'; '.join(says)}",
        "turn the sensor, reduce `reflex.distance`, or give the proof more time: "
        "`--prove-seconds 600`",
        keys=("sensors", proof.sensor),
    )


def by_link(proof: ZoneProofs) -> dict[str, list[int]]:
    """Masked zones by the link that may be in them."""
    found: dict[str, list[int]] = {}
    # Of a link a zone with a known posture comes first.
    for zone, why in sorted(
        proof.masked.items(), key=lambda item: item[1].why == "open"
    ):
        found.setdefault(why.link, []).append(zone)
    return found


def seen(proof: ZoneProofs, zone: int) -> str:
    """How a link may be in a masked zone."""
    posture = proof.masked[zone].posture
    if not posture:
        return "is not proven to stay out"
    return f"is in zone {zone} at {positions(posture)}"


def ranges(numbers: Iterable[int]) -> str:
    """Numbers as ranges.

    Example:
        >>> ranges([5, 1, 2, 3])
        '1-3, 5'
    """
    runs = groupby(enumerate(sorted(numbers)), key=lambda item: item[1] - item[0])
    parts = [[number for _, number in run] for _, run in runs]
    return ", ".join(
        f"{part[0]}-{part[-1]}" if len(part) > 1 else str(part[0]) for part in parts
    )


def settings_from(scene: Scene, proofs: list[ZoneProofs]) -> dict[str, Any]:
    """The file of the reflex, without its keys."""
    reflex = scene.reflex
    assert reflex is not None
    sensors: Mapping[str, dict[str, Any]] = {
        one.sensor: {
            "id": k,
            "timeout": PERIODS * scene.sensors[one.sensor].period,
            "vote": reflex.vote,
            "thresholds": [
                None if zone in one.masked else reflex.distance
                for zone in range(one.count)
            ],
        }
        for k, one in enumerate(proofs)
    }
    return {
        "port": reflex.port,
        "listeners": list(reflex.listeners),
        "period": reflex.period,
        "watchdog": reflex.watchdog,
        "sensors": sensors,
    }


def zone_table(proofs: list[ZoneProofs]) -> list[dict[str, object]]:
    """All proofs as plain numbers; positions in rad or m."""
    return [
        {
            "sensor": one.sensor,
            "zones": one.count,
            "proven": one.count - len(one.masked),
            "masked": [
                {"zone": zone, **why._asdict()} for zone, why in one.masked.items()
            ],
            "searches": one.searches,
            "seconds": one.seconds,
        }
        for one in proofs
    ]
