"""The scene a service guards: by file or by name, and its hash."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from hashlib import sha256
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError, did_you_mean
from armguard.geometry.shapes import Box
from armguard.geometry.shapes.kind import ShapeKind
from armguard.scene import Scene, load_scene
from armguard.scene.bay import bay_path, bay_scene
from armguard.scene.conveyor import conveyor_path
from armguard.scene.exact import ExactTables
from armguard.scene.meshes import Progress
from armguard.scene.settings import CHOICES, Mode, ResponseName
from armguard.scene.tables import SceneTables
from armguard.scene.two_pandas import sensed_table_path, two_pandas_path

Floats = NDArray[np.float64]

# Files of the scenes that come with the package.
BUNDLED: Mapping[str, Callable[[], Path]] = {
    "bay": bay_path,
    "two-pandas": two_pandas_path,
    "sensed-table": sensed_table_path,
    "conveyor": conveyor_path,
}

# Boxes a service holds ready for objects that the scene does not have, and half of
# their sizes until a client gives others [m].
SPARE_BOXES = 8
SPARE = (0.1, 0.1, 0.1)


def open_scene(
    what: str,
    *,
    period: float,
    late: float,
    stale: float | None = None,
    mode: str | None = None,
    response: str | None = None,
    progress: Progress | None = None,
) -> tuple[Scene, str]:
    """A scene for a service, and its file.

    Args:
        what: A scene file, or a name of `BUNDLED`.
        period: Time from one cycle to the next [s].
        late: How much later than that a cycle may come [s].
        stale: How old states may be before they are not believed; as the scene says if
            None [s].
        mode: How distances are made, "path" or "speed"; as the scene says if None.
        response: Response of all robots to what is near; as the scene says if None.
        progress: See `load_scene`.

    Raises:
        SceneFileError: The file is wrong.
        SceneError: There is no such file or scene, mode or response.
    """
    # Without predicted stops there are no commands.
    if mode not in (None, "path", "speed"):
        raise SceneError(f"mode is '{mode}'; it must be path or speed")
    if response not in (None, *CHOICES["kind"]):
        hint = did_you_mean(str(response), CHOICES["kind"])
        raise SceneError(f"response is '{response}'; {hint}")
    if what == "bay":
        scene, file = bay_scene("path"), str(bay_path())
    elif what in BUNDLED:
        file = str(BUNDLED[what]())
        scene = load_scene(file, progress=progress)
    elif Path(what).is_file():
        scene, file = load_scene(what, progress=progress), str(Path(what).resolve())
    else:
        raise SceneError(
            f"'{what}' is no file and no bundled scene; those are " + ", ".join(BUNDLED)
        )
    scene.period, scene.late = period, late
    for k in range(1, SPARE_BOXES + 1):
        if f"box{k}" not in scene.objects:
            scene.add(Box(size=SPARE), name=f"box{k}", present=False)
    if stale is not None:
        scene.set_stale(stale)
    if mode is not None:
        scene.set_mode(cast(Mode, mode))
    if response is not None:
        scene.set_response(cast(ResponseName, response))
    return scene, file


def scene_hash(tables: SceneTables) -> str:
    """SHA-256 of all a compiled scene says, in hex; the same in every process."""
    digest = sha256()
    add(digest, tables)
    return digest.hexdigest()


def add(digest: Any, value: Any) -> None:
    """Add a value to a digest: arrays by their bits, all else by what it says."""
    if isinstance(value, SceneTables):
        value = replace(value, local_rows=plain_rows(value.local_rows, value.kinds))
    elif isinstance(value, ExactTables):
        value = replace(value, rows=plain_rows(value.rows, value.kinds))
    digest.update(type(value).__name__.encode())
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype.str}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif value is None or isinstance(value, int | float | str | Enum):
        digest.update(repr(value).encode())
    elif is_dataclass(value) and not isinstance(value, type):
        for part in fields(value):
            digest.update(part.name.encode())
            add(digest, getattr(value, part.name))
    elif isinstance(value, Mapping):
        for key, item in value.items():
            add(digest, key)
            add(digest, item)
    elif isinstance(value, Iterable):
        for item in value:
            add(digest, item)


def plain_rows(rows: Floats, kinds: NDArray[np.int32]) -> Floats:
    """Rows without addresses, which differ from process to process.

    What they lead to is in the shapes, which the tables keep beside them.
    """
    plain = rows.copy()
    leads = (kinds == ShapeKind.HULL) | (kinds == ShapeKind.SUPPORT)
    plain[leads, 4:6] = 0.0
    return plain
