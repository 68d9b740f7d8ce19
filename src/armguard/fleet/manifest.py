"""The manifest of a job's results: all that decides them, and how they are divided."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any, Self

from armguard.errors import TrajectoryError
from armguard.fleet.inputs import Input, inputs_of
from armguard.fleet.job import RANDOM_DURATION, FleetError, JobModel, split_settings
from armguard.fleet.store import PARTS, manifest_of, part_of
from armguard.kernel import DIGEST, PACKAGE
from armguard.plans.coal_world import CoalWorld
from armguard.recording.settings import change
from armguard.scene import Scene, compile_scene, load_scene
from armguard.scene.archive import archive_of, hash_of
from armguard.service.server.scenes import BUNDLED
from armguard.simulation.closed_loop import check_scene

FILE = "manifest.json"

# Spans that a cycle of a guard may test.
BUDGET = 1024

# About how long a part of the work takes [s], and the most parts.
SHARD_SECONDS = 2.0
MOST_SHARDS = 10_000

# About how long a frame takes, and an input besides, by the work [s].
COSTS = {
    "audit": (2e-6, 1e-4),
    "audit with guard": (4e-5, 1e-3),
    "verify": (5e-6, 2e-2),
    "replay": (1e-4, 2e-1),
    "run": (0.0, 2e-2),
}

# About how long a second of a closed loop takes [s].
LOOP_SECOND = 0.07

# Keys of a job that decide no result.
NOT_DECIDING = {"memory", "time_limit"}


@cache
def code_digest() -> str:
    """Version, and hash of the kernels' digest and of all source files."""
    own = version("armguard")
    found = sha256(DIGEST.encode())
    for path in sorted(PACKAGE.rglob("*.py")):
        found.update(path.relative_to(PACKAGE).as_posix().encode())
        found.update(path.read_bytes())
    return f"{own}-{found.hexdigest()[:16]}"


@dataclass(frozen=True, slots=True)
class Manifest:
    """What results are of.

    An item is an input in a scene with a setting. Items are in the order of scenes,
    settings and inputs; a shard is a span of items in one scene with one setting.

    Attributes:
        work: "audit", "verify", "replay" or "run".
        job: The job.
        folder: The job's folder, from which its paths lead.
        code: See `code_digest`.
        scenes: Hash of each scene with each setting, by scene, then by setting.
        inputs: All inputs.
        ends: Item after the last one of each shard.
    """

    work: str
    job: JobModel
    folder: Path
    code: str
    scenes: tuple[str, ...]
    inputs: tuple[Input, ...]
    ends: tuple[int, ...]

    @classmethod
    def of(
        cls,
        work: str,
        job: JobModel,
        folder: Path,
        progress: Callable[[str, int, int], None] | None = None,
    ) -> Self:
        """The manifest of a job.

        Args:
            work: See the attribute.
            job: The job.
            folder: Its folder.
            progress: See `load_scene`.

        Raises:
            FleetError: An input is none, or the work needs other inputs or scenes.
            SceneError: A scene or a setting of it is wrong.
        """
        inputs = tuple(inputs_of(job.inputs, folder))
        check_kinds(work, job, inputs)
        settings = job.settings()
        made = [
            changed_scene(work, folder, name, one, progress)[0]
            for name in job.scenes
            for one in settings
        ]
        scenes = tuple(hash_of(archive_of(scene)) for scene in made)
        if work == "run":
            names = [name for name in job.scenes for _ in settings]
            job = judged_job(job, list(zip(names, made, strict=True)))
        ends = shard_ends(work, job, inputs)
        return cls(work, job, folder, code_digest(), scenes, inputs, ends)

    @property
    def groups(self) -> list[tuple[str, dict[str, str]]]:
        """Scene and setting of each run of items as long as the inputs."""
        settings = self.job.settings()
        return [(scene, one) for scene in self.job.scenes or [""] for one in settings]

    @property
    def items(self) -> int:
        """Their count."""
        return self.ends[-1]

    @property
    def hash(self) -> str:
        """Hash of all that decides results."""
        return sha256(json.dumps(self.deciding(), sort_keys=True).encode()).hexdigest()

    def deciding(self) -> dict[str, Any]:
        """All that decides results, by name."""
        return {
            "work": self.work,
            "job": self.job.model_dump(exclude=NOT_DECIDING),
            "code": self.code,
            "scenes": list(self.scenes),
            "inputs": [one.row() for one in self.inputs],
            "ends": list(self.ends),
        }

    def shard(self, number: int) -> tuple[int, int]:
        """First item of a shard, and the one after its last."""
        return (self.ends[number - 1] if number else 0), self.ends[number]

    def item(self, number: int) -> tuple[int, Input]:
        """Group of an item, and its input."""
        group, place = divmod(number, len(self.inputs))
        return group, self.inputs[place]

    def scene(self, group: int) -> tuple[Scene, int]:
        """The scene of a group with its setting, and the budget of its guards.

        Raises:
            FleetError: The scene changed since the manifest was written.
        """
        name, settings = self.groups[group]
        scene, budget = changed_scene(self.work, self.folder, name, settings)
        if hash_of(archive_of(scene)) != self.scenes[group]:
            raise FleetError(
                f"{name}: the scene changed since the work began; use another --out"
            )
        return scene, budget

    def own_settings(self, group: int) -> dict[str, float]:
        """Settings of a group that are those of the work, by name."""
        return split_settings(self.work, self.groups[group][1])[1]

    def write(self, out: Path) -> None:
        """Write it beside the results."""
        kept = self.deciding() | {"job": self.job.model_dump()}
        kept |= {"folder": str(self.folder), "hash": self.hash}
        temporary = out / f".{FILE}"
        temporary.write_text(json.dumps(kept), encoding="utf-8")
        temporary.replace(out / FILE)

    @classmethod
    def read(cls, out: Path) -> Self:
        """The manifest of results.

        Raises:
            FleetError: There is none, or it is damaged.
        """
        path = out / FILE
        try:
            kept = json.loads(path.read_text(encoding="utf-8"))
            made = cls(
                work=kept["work"],
                job=JobModel.model_validate(kept["job"]),
                folder=Path(kept["folder"]),
                code=kept["code"],
                scenes=tuple(kept["scenes"]),
                inputs=tuple(Input(*row) for row in kept["inputs"]),
                ends=tuple(kept["ends"]),
            )
            intact = made.hash == kept["hash"]
        except OSError as error:
            raise FleetError(
                f"'{path}' cannot be read: {error.strerror or error}"
            ) from None
        except (ValueError, KeyError, TypeError) as error:
            raise FleetError(f"{path}: it is no manifest: {error}") from None
        if not intact:
            raise FleetError(f"{path}: it was changed; use another --out")
        return made


def check_kinds(work: str, job: JobModel, inputs: Sequence[Input]) -> None:
    """Refuse inputs and scenes that the work has no use for.

    Raises:
        FleetError: There are some.
    """
    known = {
        "audit": ("dataset", "recording", "plan"),
        "verify": ("recording", "plan"),
        "replay": ("recording",),
        "run": ("random motion", "dataset", "recording", "plan"),
    }[work]
    for one in inputs:
        if one.kind not in known:
            raise FleetError(
                f"{one.source}: `{work}` has no use for a {one.kind}; it takes "
                f"a {' or a '.join(known)}"
            )
    if work == "replay" and job.scenes:
        raise FleetError("a recording is replayed in its own scene; give no scenes")
    if work != "replay" and not job.scenes:
        raise FleetError(f"`{work}` needs a scene; give one or more")
    if work != "run" and (job.duration is not None or job.judge is not None):
        raise FleetError("duration and judge are keys of `run` alone; leave them out")
    for settings in job.settings():
        split_settings(work, settings)


def changed_scene(
    work: str,
    folder: Path,
    name: str,
    settings: dict[str, str],
    progress: Callable[[str, int, int], None] | None = None,
) -> tuple[Scene, int]:
    """A scene with other settings, and the budget of its guards.

    Args:
        work: See `Manifest`.
        folder: The job's folder.
        name: A file, or a bundled scene where there is no such file.
        settings: Other settings by name.
        progress: See `load_scene`.
    """
    path = folder / name
    if name in BUNDLED and not path.exists():
        path = BUNDLED[name]()
    scene = load_scene(path, progress=progress)
    changed = change(scene, BUDGET, split_settings(work, settings)[0])
    return changed.scene, changed.budget


def judged_job(job: JobModel, scenes: Sequence[tuple[str, Scene]]) -> JobModel:
    """A job of closed loops with the name of its judge, one for all of its scenes.

    Args:
        job: The job.
        scenes: Its scenes by name, with each setting.

    Raises:
        SceneError: A scene cannot be simulated.
        TrajectoryError: The job names Coal, which is missing or lacks a shape.
    """
    tables = [compile_scene(scene) for _, scene in scenes]
    for (name, scene), own in zip(scenes, tables, strict=True):
        check_scene(name, scene, own)
    if job.judge == "checker":
        return job
    try:
        for own in tables:
            CoalWorld(own, exact=True)
    except TrajectoryError:
        if job.judge is not None:
            raise
        return job.model_copy(update={"judge": "checker"})
    return job.model_copy(update={"judge": "coal"})


def costs(work: str, job: JobModel, inputs: Sequence[Input]) -> list[float]:
    """About how long each input takes in one scene with one setting [s]."""
    guarded = " with guard" if work == "audit" and job.guard else ""
    frame, base = COSTS[work + guarded]
    if work == "run":
        base += LOOP_SECOND * (job.duration or RANDOM_DURATION)
    return [base + frame * one.frames for one in inputs]


def part_seconds(work: str, job: JobModel, inputs: Sequence[Input]) -> float:
    """About how long a part takes [s]."""
    groups = max(len(job.scenes), 1) * len(job.settings())
    whole = groups * sum(costs(work, job, inputs))
    return max(SHARD_SECONDS, 1.1 * whole / MOST_SHARDS)


def shard_ends(work: str, job: JobModel, inputs: Sequence[Input]) -> tuple[int, ...]:
    """Item after the last one of each shard."""
    longest, each = part_seconds(work, job, inputs), costs(work, job, inputs)
    ends, lasted = [], 0.0
    for k, cost in enumerate(each):
        lasted += cost
        if lasted >= longest or k + 1 == len(each):
            ends.append(k + 1)
            lasted = 0.0
    count, groups = len(inputs), max(len(job.scenes), 1) * len(job.settings())
    return tuple(group * count + end for group in range(groups) for end in ends)


def settle(out: Path, made: Manifest) -> list[int]:
    """Begin in a folder, or go on there: the shards that are missing.

    Args:
        out: Folder of the results.
        made: The manifest of the job as it is now.

    Raises:
        FleetError: The folder holds results of something else.
    """
    out.mkdir(parents=True, exist_ok=True)
    if (out / FILE).exists():
        before = Manifest.read(out)
        if before.hash != made.hash:
            raise FleetError(
                f"{out}: its results are of another job: {difference(before, made)}; "
                "use another --out, or delete the folder"
            )
    elif any(out.glob(PARTS)):
        raise FleetError(f"{out}: it holds results without {FILE}; use another --out")
    made.write(out)
    for path in sorted(out.glob(PARTS)):
        if manifest_of(path) != made.hash:
            raise FleetError(
                f"{path}: it was written for another job, or by other code; delete it"
            )
    return [k for k in range(len(made.ends)) if not part_of(out, k).exists()]


def difference(before: Manifest, now: Manifest) -> str:
    """What differs between two manifests, in words."""
    old, new = before.deciding(), now.deciding()
    for name, words in (
        ("work", "other work"),
        ("code", f"code {before.code}, now {now.code}"),
        ("job", "other settings"),
        ("scenes", "a scene changed"),
    ):
        if old[name] != new[name]:
            return words
    for one, other in zip(before.inputs, now.inputs, strict=False):
        if one != other:
            return f"input {other.name} changed"
    return f"{len(before.inputs)} inputs, now {len(now.inputs)}"
