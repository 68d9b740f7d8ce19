"""Certificates of plans: every tile of a proof, for others to recheck."""

from dataclasses import dataclass, fields
from hashlib import sha256
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from armguard.errors import TrajectoryError
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]


class CertificateError(TrajectoryError):
    """A certificate does not prove what it claims, or belongs to something else."""


@dataclass(frozen=True, slots=True)
class Certificate:
    """Tiles of a plan, and what is known of each pair in them.

    A pair that is not open in a tile keeps its buffer there. Leaves hold every open
    pair over all of its tile.

    Attributes:
        scene: Hash of the scene, see `scene_hash`.
        q_names: 'robot/joint' of each joint.
        times: See `Tube`.
        control: Control points of the curves, see `Tube`.
        links: Names of links and objects.
        tiles: Segment, and shares of it where each tile begins and ends, shape (k, 3).
        open: Tile and both links of each pair that is open in it, shape (m, 3).
        pairs: Both links of each pair that leaves name, shape (c, 2).
        leaves: Pair, segment, shares where it begins and ends, what is known (0: it
            keeps its buffer), and a bound of the distance from below [m], shape (l, 6).
    """

    scene: str
    q_names: tuple[str, ...]
    times: Floats
    control: Floats
    links: tuple[str, ...]
    tiles: Floats
    open: Longs
    pairs: Longs
    leaves: Floats

    @property
    def digest(self) -> str:
        """Hash of all numbers and names."""
        found = sha256()
        for field in fields(self):
            value = np.ascontiguousarray(getattr(self, field.name))
            found.update(f"{field.name} {value.dtype.kind} {value.shape}".encode())
            found.update(value.tobytes())
        return found.hexdigest()

    def write(self, path: Path) -> None:
        """Write it as an NPZ file."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        with path.open("wb") as file:
            np.savez_compressed(file, digest=self.digest, **arrays)

    @classmethod
    def read(cls, path: Path) -> "Certificate":
        """Read it again.

        Raises:
            CertificateError: The file is no certificate, or not as it was written.
        """
        try:
            with np.load(path, allow_pickle=False) as held:
                arrays = dict(held)
            made = cls(
                scene=str(arrays["scene"]),
                q_names=tuple(map(str, arrays["q_names"])),
                links=tuple(map(str, arrays["links"])),
                **{name: arrays[name] for name in ARRAYS},
            )
            digest = str(arrays["digest"])
        except OSError as error:
            raise CertificateError(
                f"'{path}' cannot be read: {error.strerror or error}"
            ) from None
        except (KeyError, ValueError, EOFError, BadZipFile) as error:
            raise CertificateError(
                f"'{path.name}' is no certificate of `armguard verify`: {error}"
            ) from None
        if digest != made.digest:
            raise CertificateError(
                f"{path.name}: its numbers are not those that were written; prove the "
                "plan again"
            )
        return made


# Fields that are arrays of numbers.
ARRAYS = ("times", "control", "tiles", "open", "pairs", "leaves")


def scene_hash(tables: SceneTables) -> str:
    """Hash of all that distances in a scene depend on."""
    found = sha256(repr((tables.q_names, tables.labels)).encode())
    for array in (
        tables.parent,
        tables.joint_kind,
        tables.q_index,
        tables.gain,
        tables.T_parent_joint,
        tables.axis,
        tables.kinds,
        tables.bodies,
        tables.local_rows,
        tables.groups,
        tables.checked,
        tables.buffers,
    ):
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()
