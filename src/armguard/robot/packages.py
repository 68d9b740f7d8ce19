"""Where a mesh lies: `package://`, `file://`, relative and absolute names."""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath

from lxml import etree

from armguard.bounded import is_file, read_bytes, shown
from armguard.errors import MeshError, did_you_mean

# Folders above a URDF that are searched for a package [-].
SEARCH_HEIGHT = 8

# How names begin that start with a package.
SCHEMES = ("package://", "model://")

# How names of packages with meshes end.
ENDINGS = ("_description", "_descriptions", "_support", "_data")

# Places a message lists.
PLACES = 3

# Largest package.xml [byte].
MOST_PACKAGE_BYTES = 1_000_000


def find_file(
    name: str,
    urdf: Path,
    packages: Mapping[str, Path] | None = None,
    folder: Path | None = None,
) -> Path:
    """File a URDF names.

    `package://NAME/rest` is looked for in the package given, there by the longest tail
    of `rest` that exists; without one, in ROS_PACKAGE_PATH and
    AMENT_PREFIX_PATH, in folders above the URDF that are called NAME or whose
    package.xml says so, and last by the longest tail of the name that exists above
    the URDF: package names in the wild often match no folder. `file://` and absolute
    names of another machine are looked for below all packages given, by their longest
    tail that has a folder.

    Wherever the name leads, the file must be below the URDF's folder or the package
    it is part of, the scene file's folder, a package given, or a package of that name
    that is found; links are followed first. A package is a folder with a package.xml.

    Args:
        name: As written in the URDF.
        urdf: The URDF.
        packages: Folders of packages by name.
        folder: The scene file's folder, if a scene file names the URDF.

    Raises:
        MeshError: There is no such file, with the line that remedies it and the first
            places, or it is elsewhere.
    """
    found: list[Path] = []
    own = [package_of(urdf), *([] if folder is None else [folder])]
    tried: list[Path] = []
    for path in candidates(name, urdf, packages or {}, found):
        if is_file(path):
            return path_below(name, path, [*own, *(packages or {}).values(), *found])
        tried.append(path)
    raise MeshError(not_found(name, urdf, [*dict.fromkeys(map(str, tried))]))


def not_found(name: str, urdf: Path, places: list[str]) -> str:
    """That a mesh was not found, the line that remedies it, and the first places.

    Args:
        name: As written in the URDF.
        urdf: The URDF.
        places: Where it was looked for.
    """
    remedy = "copy it there, or correct the name"
    if is_placed(name):
        package = package_in(name)
        remedy = f"set its folder: `packages: {{{package}: FOLDER}}`"
    if len(places) > PLACES:
        places = [*places[:PLACES], f"… {len(places) - PLACES} more"]
    return "\n  ".join(
        [f"'{urdf.name}' names the mesh '{shown(name)}', not found; {remedy}", *places]
    )


def is_placed(name: str) -> bool:
    """Whether a name starts with a package, or with a place of its maker's machine."""
    return name.startswith((*SCHEMES, "file://", "/"))


def package_in(name: str) -> str:
    """Name of the package that a mesh most likely belongs to."""
    parts = PurePosixPath(name.split("://", 1)[-1]).parts
    if name.startswith(SCHEMES):
        return parts[0] if parts else "NAME"
    likely = [part for part in parts if part.endswith(ENDINGS)]
    return (likely or [*parts[-2:-1], "NAME"])[0].strip("/") or "NAME"


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
    if not is_placed(name):
        yield folder / name
        return
    if not name.startswith(SCHEMES):
        path = PurePosixPath(name.removeprefix("file://"))
        yield Path(path)
        yield from tails(path.parts[1:], packages.values())
        return
    package, _, rest = name.split("://", 1)[1].partition("/")
    if package in packages:
        yield Path(packages[package]) / rest
        yield from tails(PurePosixPath(rest).parts[1:], [packages[package]])
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


def tails(parts: Sequence[str], folders: Iterable[Path]) -> Iterator[Path]:
    """Ends of a path below folders, the longest first; a file's name alone is none."""
    for start in range(len(parts) - 1):
        for folder in folders:
            yield Path(folder).joinpath(*parts[start:])


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
