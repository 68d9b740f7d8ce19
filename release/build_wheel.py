"""Builds the wheel, with its kernels compiled.

make dist

Compiles for x86-64-v3 what a guard, a service, the demo and fits need, about three
minutes of processor time. Writes dist/armguard-*.whl for this version of Python.
"""

import importlib
import os
import pkgutil
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
BUILD = ROOT / "build" / "wheel"
DIST = ROOT / "dist"

# Older systems have no Numba either.
PLATFORM = "manylinux_2_28_x86_64"

# What the wheel is made of.
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "NOTICE")

# What the service, the simulated arms and meshes need besides.
PROGRAMS = (
    ("demo", "--headless", "--seconds", "1"),
    ("demo", "--headless", "--seconds", "1", "--scene", "two-pandas"),
)


def compile_kernels() -> None:
    """Compile what a guard needs, then what programs add to it."""
    from armguard.respond import Guard
    from armguard.respond.compiling import compile_ahead
    from armguard.respond.evasion import evade_all
    from armguard.respond.guard import try_out
    from armguard.scene import bay_scene
    from armguard.separate import link_missing

    compile_ahead(print, True, try_out)
    guard = Guard(bay_scene("path"))
    guard.restore(guard.checkpoint())
    # Moving objects, which no program below has.
    link_missing(evade_all)
    for arguments in PROGRAMS:
        subprocess.run([sys.executable, "-m", "armguard", *arguments], check=True)


def fit_links() -> None:
    """Fit the links of a robot whose meshes need all kernels of fits."""
    from armguard.robot import find_named_robot, load_urdf
    from armguard.robot.fitting import fit_link

    for link in load_urdf(find_named_robot("xarm7").urdf).links.values():
        fit_link(link)


def emitted_kernels() -> Iterator[Any]:
    """The dispatchers of all kernels that are entered, and of none that is inlined."""
    import armguard
    from armguard.kernel import EntryDispatcher
    from armguard.separate import SeparateKernel

    for module in pkgutil.walk_packages(armguard.__path__, "armguard."):
        if module.name.endswith("__main__"):
            continue
        try:
            names = vars(importlib.import_module(module.name))
        except ImportError:
            # A part whose libraries are not installed.
            continue
        for value in names.values():
            one = value.dispatcher if isinstance(value, SeparateKernel) else value
            emitted = one is not value or isinstance(value, EntryDispatcher)
            if emitted and one.py_func.__module__ == module.name:
                yield one


def stage() -> Path:
    """Lay out the sources of the wheel, its object code among them."""
    from armguard.kernel import DIGEST
    from armguard.ready import place_of_ready_code, write_ready

    tree = BUILD / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    left_out = shutil.ignore_patterns("__pycache__", "*.egg-info")
    shutil.copytree(ROOT / "src", tree / "src", ignore=left_out)
    for name in SOURCES:
        shutil.copy2(ROOT / name, tree / name)
    folder = place_of_ready_code(tree / "src" / "armguard", DIGEST)
    folder.mkdir(parents=True)
    for kernel in emitted_kernels():
        code = kernel._cache.kept()
        if code:
            write_ready(folder / kernel._cache.name, code)
    return tree


def build(tree: Path) -> None:
    """Write the wheel of a tree, in place of an older one."""
    for older in DIST.glob("armguard-*.whl"):
        older.unlink()
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    tags = f"--build-option=--python-tag={python} --plat-name={PLATFORM}"
    subprocess.run(
        [
            *(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"),
            *("--no-build-isolation", "--disable-pip-version-check"),
            *("--config-settings", tags, "--wheel-dir", str(DIST), str(tree)),
        ],
        check=True,
    )


def main() -> None:
    """Compile, lay out, write."""
    # Read when Numba is imported. Without the second setting code for another processor
    # may use all that this one has.
    os.environ["NUMBA_CPU_NAME"] = "x86-64-v3"
    os.environ["NUMBA_CPU_FEATURES"] = ""
    os.environ["ARMGUARD_CACHE"] = str(BUILD / "cache")
    shutil.rmtree(BUILD / "cache", ignore_errors=True)
    compile_kernels()
    fit_links()
    build(stage())


if __name__ == "__main__":
    main()
