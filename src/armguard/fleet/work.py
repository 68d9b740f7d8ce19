"""The work of a fleet: results of items, in the order of the items."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from armguard.errors import ArmguardError
from armguard.fleet.audit import Auditor
from armguard.fleet.episodes import frames_of, opened
from armguard.fleet.inputs import DATASET, Input
from armguard.fleet.job import FleetError
from armguard.fleet.loops import Loops
from armguard.fleet.manifest import Manifest, code_digest
from armguard.fleet.result import empty_row, failed_row, finding, item_rows
from armguard.plans.plan import Plan
from armguard.plans.proof import PlanProof
from armguard.plans.verify import PlanVerifier
from armguard.recording import open_recording
from armguard.recording.comparison import compare
from armguard.recording.replay import replay
from armguard.respond.guard import try_out
from armguard.scene import Trajectory

# A motion of all joints that loads the kernels [rad or m].
WARM = 0.5

Rows = Iterator[dict[str, Any]]


class Work:
    """Results of a manifest, one scene with one setting in memory at a time.

    Attributes:
        manifest: The manifest.

    Args:
        out: Folder of the results.

    Raises:
        FleetError: There is no manifest in it, or it is of other code.
    """

    def __init__(self, out: Path) -> None:
        self.manifest = Manifest.read(out)
        if self.manifest.code != code_digest():
            raise FleetError(
                f"the code here is {code_digest()}, but the results are of "
                f"{self.manifest.code}; install the same version of armguard"
            )
        self._group = -1
        self._judge: Callable[[list[Input]], Rows]

    def prepare(self, first: int, end: int) -> None:
        """Load what a span of items needs, and the kernels; see `rows`."""
        group, one = self.manifest.item(first)
        sources = {self.manifest.item(k)[1].source for k in (first, end - 1)}
        for source in sources if one.kind == DATASET else ():
            # One that is wrong is an error of its episodes.
            with suppress(ArmguardError):
                opened(self.manifest.folder / source)
        if group == self._group:
            return
        makers = {
            "audit": self._audit,
            "verify": self._verify,
            "replay": self._replay,
            "run": self._run,
        }
        self._judge = makers[self.manifest.work](group)
        self._group = group

    def rows(self, first: int, end: int) -> list[dict[str, Any]]:
        """Results of a span of items of one scene with one setting.

        Args:
            first: First item.
            end: The one after the last.
        """
        self.prepare(first, end)
        inputs = [self.manifest.item(k)[1] for k in range(first, end)]
        found = list(self._judge(inputs))
        assert len(found) == end - first
        return item_rows(self.manifest, first, found)

    def _audit(self, group: int) -> Callable[[list[Input]], Rows]:
        """An audit of recorded frames."""
        scene, budget = self.manifest.scene(group)
        job, folder = self.manifest.job, self.manifest.folder
        auditor = Auditor(scene, budget, job)
        auditor.warm_up()

        def audit(inputs: list[Input]) -> Rows:
            for frames in frames_of(inputs, job, folder, scene):
                if isinstance(frames, tuple):
                    yield failed_row(*frames)
                else:
                    yield from auditor.audit(frames)

        return audit

    def _verify(self, group: int) -> Callable[[list[Input]], Rows]:
        """Proofs of plans."""
        scene, _ = self.manifest.scene(group)
        job, folder = self.manifest.job, self.manifest.folder
        errors = self.manifest.own_settings(group)
        verifier = PlanVerifier(scene)
        rows = np.array([scene.home, scene.home + WARM, scene.home])
        warm = Trajectory(scene.q_names, rows, np.array([0.0, 1.0, 2.0]), "warm-up")
        verifier.verify(Plan.of(warm, scene))

        def verify(inputs: list[Input]) -> Rows:
            for one in inputs:
                try:
                    plan = Plan.read(
                        folder / one.source,
                        scene,
                        interpolation=job.interpolation,
                        hold_home=job.hold_home,
                    )
                    proof = verifier.verify(plan, **errors)
                    yield row_of_proof(one, proof, len(plan.tube.times))
                except ArmguardError as error:
                    yield failed_row(one, str(error))

        return verify

    def _run(self, group: int) -> Callable[[list[Input]], Rows]:
        """Closed loops of motions."""
        loops = Loops(self.manifest, group)
        loops.warm_up()

        def run(inputs: list[Input]) -> Rows:
            for one in inputs:
                try:
                    yield loops.row(one)
                except ArmguardError as error:
                    yield failed_row(one, str(error))

        return run

    def _replay(self, group: int) -> Callable[[list[Input]], Rows]:
        """Recordings judged again, the same way or with other settings."""
        settings, folder = self.manifest.groups[group][1], self.manifest.folder
        with suppress(ArmguardError):
            try_out(open_recording(folder / self.manifest.inputs[0].source).scene())

        def again(inputs: list[Input]) -> Rows:
            for one in inputs:
                try:
                    yield replayed_row(one, folder / one.source, settings)
                except ArmguardError as error:
                    yield failed_row(one, str(error))

        return again


def row_of_proof(one: Input, proof: PlanProof, rows: int) -> dict[str, Any]:
    """The result of a plan."""
    row = empty_row(one, rows)
    row["clear"] = proof.clear
    if proof.timed:
        row["duration"] = proof.end - proof.start
    row["contacts"] = sum(each.contact is not None for each in proof.intervals)
    if proof.least is not None:
        least = proof.least
        row |= {"least": least.distance, "a": least.a, "b": least.b}
        row["time"] = least.time
    if proof.order is not None:
        row["stop"] = proof.order.time
    for each in proof.intervals:
        place, kind = (
            each.nearest,
            "contact" if each.contact is not None else "too near",
        )
        text = (
            f"{place.a} to {place.b}: {1e3 * place.distance:.2f} mm at {place.time:.4f}"
        )
        row["findings"].append(
            finding(kind, place.a, place.b, each.start, each.end, place.distance, text)
        )
    return row


def replayed_row(one: Input, path: Path, settings: dict[str, str]) -> dict[str, Any]:
    """The result of a recording: clear if nothing differs."""
    recording = open_recording(path)
    if not settings:
        same = replay(recording)
        row = empty_row(one, same.cycles) | {"clear": same.identical}
        if not same.identical:
            row["time"] = same.different_time
            row["findings"].append(
                finding("different", start=same.different_time, text=same.sentence)
            )
        return row
    found = compare(recording, settings)
    first = found.first_difference
    row = empty_row(one, found.cycles)
    row["clear"] = found.cycles > 0 and first is None
    if found.changed.least_distance < float("inf"):
        row["least"] = found.changed.least_distance
    if first is not None:
        row["time"] = first["time"]
        row["findings"].append(
            finding("different", start=first["time"], text=first["what"])
        )
    for kind, stops in (("stop avoided", found.gone), ("stop added", found.new)):
        for stop in stops:
            row["findings"].append(
                finding(kind, stop.robot, start=stop.time, text=stop.why)
            )
    if found.changed.stops:
        row["stop"] = found.changed.stops[0].time
        row["stop_reason"] = found.changed.stops[0].reason
    return row
