"""Where a mesh lies: `package://`, `file://`, relative and absolute names."""

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

from lxml import etree

from armguard.bounded import is_file, read_bytes, shown
from armguard.errors import MeshError, did_you_mean

# Folders above a URDF that are searched for a package [-].
SEARCH_HEIGHT = 8

# How names begin that start with a package.
SCHEMES = ("package://", "model://")

# Largest package.xml [byte].
MOST_PACKAGE_BYTES = 1_000_000


def find_file(
    name: str,
    urdf: Path,
    packages: Mapping[str, Path] | None = None,
    folder: Path | None = None,
) -> Path:
    """File a URDF names.

    `package://NAME/rest` is looked for in the packages given, in ROS_PACKAGE_PATH and
    AMENT_PREFIX_PATH, in folders above the URDF that are called NAME or whose
    package.xml says so, and last by the longest tail of the name that exists above
    the URDF: package names in the wild often match no folder.

    Wherever the name leads, the file must be below the URDF's folder or the package
    it is part of, the scene file's folder, a package given, or a package of that name
    that is found; links are followed first. A package is a folder with a package.xml.

    Args:
        name: As written in the URDF.
        urdf: The URDF.
        packages: Folders of packages by name.
        folder: The scene file's folder, if a scene file names the URDF.

    Raises:
        MeshError: There is no such file, with a list of where it was sought, or it is
            elsewhere.
    """
    found: list[Path] = []
    own = [package_of(urdf), *([] if folder is None else [folder])]
    tried: list[Path] = []
    for path in candidates(name, urdf, packages or {}, found):
        if is_file(path):
            return path_below(name, path, [*own, *(packages or {}).values(), *found])
        tried.append(path)
    listed = "\n  ".join(str(path) for path in dict.fromkeys(tried))
    raise MeshError(
        f"'{urdf.name}' names the mesh '{shown(name)}', which is in none of these "
        f"places:\n  {listed}\ngive the package's folder with `packages`"
    )


def find_in(name: str, folder: Path, packages: Mapping[str, Path]) -> Path:
    """File a scene file names for an object; see `find_file`.

    Args:
        name: As written in the scene file.
        folder: The scene file's folder.
        packages: Folders the scene file declares, by name.

    Raises:
        MeshError: Its package is not declared, or it is elsewhere.
    """
    path = folder / name
    if name.startswith(SCHEMES):
        package, _, rest = name.split("://", 1)[1].partition("/")
        if package not in packages:
            raise MeshError(
                f"mesh '{shown(name)}' is in a package that is not declared; "
                f"{did_you_mean(package, packages)}; add `packages: "
                f"{{{shown(package)}: FOLDER}}`"
            )
        path = packages[package] / rest
    return path_below(name, path, [folder, *packages.values()])


def path_below(name: str, path: Path, roots: Iterable[Path]) -> Path:
    """The path with all links followed, if it is below one of the folders.

    Raises:
        MeshError: It is below none of them.
    """
    try:
        resolved = path.resolve()
        if any(resolved.is_relative_to(root.resolve()) for root in roots):
            return resolved
    except (OSError, ValueError, RuntimeError):
        raise MeshError(f"mesh '{shown(name)}' has no name of a file") from None
    raise MeshError(
        f"mesh '{shown(name)}' is outside of the folders that may be read; if it "
        "belongs to the scene, declare its folder with `packages: {NAME: FOLDER}` or "
        "copy it beside the scene"
    )


def candidates(
    name: str, urdf: Path, packages: Mapping[str, Path], found: list[Path]
) -> Iterator[Path]:
    """Places a file may be in, the likeliest first.

    Args:
        name: As written in the URDF.
        urdf: The URDF.
        packages: Folders of packages by name.
        found: Receives folders of packages of that name, as they are found.
    """
    folder = urdf.resolve().parent
    if name.startswith("file://"):
        yield Path(name.removeprefix("file://"))
        return
    if not name.startswith(SCHEMES):
        yield folder / name
        return
    package, _, rest = name.split("://", 1)[1].partition("/")
    if package in packages:
        yield Path(packages[package]) / rest
        return
    if package in ("", ".", ".."):
        package = ""
    for variable, inner in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
        roots = os.environ.get(variable, "").split(os.pathsep) if package else []
        for root in filter(None, roots):
            found.append(Path(root) / inner / package)
            yield found[-1] / rest
    above = [folder, *folder.parents][:SEARCH_HEIGHT]
    for parent in above:
        for place in (parent, parent / package):
            if package and package_name(place) == package:
                found.append(place)
        if parent.name == package or parent in found:
            yield parent / rest
        yield parent / package / rest
    parts = PurePosixPath(package, rest).parts
    for start in range(1, len(parts)):
        for parent in above:
            yield parent.joinpath(*parts[start:])


def package_of(urdf: Path) -> Path:
    """Folder of the package a URDF is part of, else the URDF's own folder."""
    folder = urdf.resolve().parent
    for parent in [folder, *folder.parents][:SEARCH_HEIGHT]:
        if is_file(parent / "package.xml"):
            return parent
    return folder


def package_name(folder: Path) -> str | None:
    """Name in a folder's package.xml, None if it has none that can be read."""
    path = folder / "package.xml"
    parser = etree.XMLParser(resolve_entities=False, no_network=True)
    try:
        source = read_bytes(path, MOST_PACKAGE_BYTES)
        return etree.fromstring(source, parser).findtext("name")
    except (etree.XMLSyntaxError, OSError):
        return None
