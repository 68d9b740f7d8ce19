"""Where a mesh lies: `package://`, `file://`, relative and absolute names."""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath

from lxml import etree

from armguard.errors import MeshError

# Folders above a URDF that are searched for a package [-].
SEARCH_HEIGHT = 8


def find_file(
    name: str, urdf: Path, packages: Mapping[str, Path] | None = None
) -> Path:
    """File a URDF names.

    `package://NAME/rest` is looked for in the packages given, in ROS_PACKAGE_PATH and
    AMENT_PREFIX_PATH, in folders above the URDF that are called NAME or whose
    package.xml says so, and last by the longest tail of the name that exists above
    the URDF: package names in the wild often match no folder.

    Args:
        name: As written in the URDF.
        urdf: The URDF.
        packages: Folders of packages by name.

    Raises:
        MeshError: There is no such file; the message lists where it was sought.
    """
    tried: list[Path] = []
    for path in candidates(name, urdf, packages or {}):
        if path.is_file():
            return path.resolve()
        tried.append(path)
    listed = "\n  ".join(str(path) for path in dict.fromkeys(tried))
    raise MeshError(
        f"'{urdf.name}' names the mesh '{name}', which is in none of these places:\n"
        f"  {listed}\ngive the package's folder with `packages`"
    )


def candidates(name: str, urdf: Path, packages: Mapping[str, Path]) -> Iterator[Path]:
    """Places a file may be in, the likeliest first."""
    folder = urdf.resolve().parent
    if name.startswith("file://"):
        yield Path(name.removeprefix("file://"))
        return
    if not name.startswith(("package://", "model://")):
        yield folder / name
        return
    package, _, rest = name.split("://", 1)[1].partition("/")
    if package in packages:
        yield Path(packages[package]) / rest
        return
    for variable, inner in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
        for root in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            yield Path(root) / inner / package / rest
    above = [folder, *folder.parents][:SEARCH_HEIGHT]
    for parent in above:
        if parent.name == package or package_name(parent) == package:
            yield parent / rest
        yield parent / package / rest
    parts = PurePosixPath(package, rest).parts
    for start in range(1, len(parts)):
        for parent in above:
            yield parent.joinpath(*parts[start:])


def package_name(folder: Path) -> str | None:
    """Name in a folder's package.xml, None if it has none that can be read."""
    path = folder / "package.xml"
    if not path.is_file():
        return None
    parser = etree.XMLParser(resolve_entities=False, no_network=True)
    try:
        return etree.parse(str(path), parser).getroot().findtext("name")
    except (etree.XMLSyntaxError, OSError):
        return None
