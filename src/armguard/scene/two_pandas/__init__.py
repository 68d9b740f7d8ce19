"""Two Pandas face to face at a table, as data."""

from pathlib import Path

from armguard.scene.file import load_scene
from armguard.scene.scene import Scene

FOLDER = Path(__file__).parent


def two_pandas_path() -> Path:
    """The scene file; it needs the extra `robots`."""
    return FOLDER / "two_pandas.yaml"


def sensed_table_path() -> Path:
    """The file of a scene whose table only sensors see; it needs the extra `robots`."""
    return FOLDER / "sensed_table.yaml"


def two_pandas_scene() -> Scene:
    """Two real robots at one table, with obstacles and blocks to grip.

    Example:
        >>> from armguard.scene.two_pandas import two_pandas_scene
        >>> list(two_pandas_scene().robots)
        ['near', 'far']
    """
    return load_scene(two_pandas_path())
