"""Bombs and mutants of every input file, thrown at the readers.

Each is read in a process of its own that may take 1 GB more than the libraries do and
20 s. What counts is how it ends: read, refused in one sentence, or badly.
"""

import os
import resource
import shutil
import struct
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

# Loaded here, so that it does not count where a reader loads it.
import trimesh  # noqa: F401

from armguard.errors import ArmguardError
from armguard.robot import load_urdf
from armguard.robot.meshes import load_triangles
from armguard.robot.model import MeshFile
from armguard.robot.srdf import load_srdf
from armguard.scene import load_scene
from armguard.scene.trajectory_file import load_trajectory

# What a reader may take beside the libraries [byte], and how long [s].
MEMORY = 1_000_000_000
PATIENCE = 20.0

# Exit codes of the child.
READ, REFUSED, TRACEBACK, NO_MEMORY = 0, 2, 3, 4

Rng = np.random.Generator
Bomb = Callable[[Path], Path]

ARM = """<robot name="r">
 <link name="a"><collision><geometry>{geometry}</geometry></collision></link>
 <link name="b"/>
 <joint name="j" type="revolute"><parent link="a"/><child link="b"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>
"""
SPHERE = '<sphere radius="0.1"/>'
SCENE = """robots:
  arm: {urdf: r.urdf, stopping: {deceleration: 5.0}}
objects:
  table: {box: [1.0, 1.0, 0.1], at: {xyz: [0.0, 0.0, -1.0]}}
  ball: {sphere: {radius: 0.1}, at: {xyz: [0.0, 2.0, 0.0], rpy: [0.0, 0.1, 0.0]}}
"""


def read(path: Path) -> object:
    """Read a file by the reader of its kind."""
    if path.suffix == ".srdf":
        return load_srdf(path, load_urdf(path.with_name("r.urdf")))
    if path.suffix == ".urdf":
        return load_urdf(path)
    if path.stem.startswith("motion"):
        return load_trajectory(path)
    if path.suffix in (".yaml", ".yml"):
        return load_scene(path)
    return load_triangles(MeshFile(path))


def ended(path: Path) -> tuple[int, float, float]:
    """Read a file in a child: its exit code, how long it took [s], its memory [MB]."""
    start = time.monotonic()
    child = os.fork()
    if child == 0:
        for stream in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
        os._exit(outcome(path))
    while True:
        done, status, used = os.wait4(child, os.WNOHANG)
        took = time.monotonic() - start
        if done:
            return os.waitstatus_to_exitcode(status), took, used.ru_maxrss / 1024
        if took > PATIENCE:
            os.kill(child, 9)
        time.sleep(0.002)


def outcome(path: Path) -> int:
    """Read a file within the limits; the exit code of the child."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * os.sysconf("SC_PAGE_SIZE") + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    try:
        read(path)
    except ArmguardError as error:
        return REFUSED if 0 < len(str(error)) < 10_000 else TRACEBACK
    except MemoryError:
        return NO_MEMORY
    except BaseException:
        return TRACEBACK
    return READ


def text(name: str, content: str | bytes) -> Bomb:
    """A bomb that is a text, or bytes."""

    def write(folder: Path) -> Path:
        data = content.encode() if isinstance(content, str) else content
        (folder / name).write_bytes(data)
        return folder / name

    return write


def aliases(sign: str) -> str:
    """Nine lines, each nine times the one before: lists, or merge keys."""
    lines = ["a0: &a0 {k: 1}" if sign == "<<" else "a0: &a0 [x]"]
    for k in range(1, 9):
        inner = ", ".join([f"*a{k - 1}"] * 9)
        lines.append(
            f"a{k}: &a{k} {{<<: [{inner}]}}"
            if sign == "<<"
            else f"a{k}: &a{k} [{inner}]"
        )
    return "\n".join(lines) + "\n"


def archive(name: str, sizes: dict[str, bytes]) -> Bomb:
    """An NPZ of members that may be anything."""

    def write(folder: Path) -> Path:
        with zipfile.ZipFile(folder / name, "w", zipfile.ZIP_DEFLATED) as file:
            for member, content in sizes.items():
                file.writestr(member, content)
        return folder / name

    return write


def array_header(shape: str, kind: str = "<f8") -> bytes:
    """An array that says it has a shape."""
    head = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}}}"
    head = head.ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode()


def long_file(name: str, size: int, head: bytes = b"") -> Bomb:
    """A file with a hole: as long as it says, though it takes no room on disk."""

    def write(folder: Path) -> Path:
        (folder / name).write_bytes(head)
        os.truncate(folder / name, size)
        return folder / name

    return write


def link(name: str, target: str) -> Bomb:
    """A symbolic link."""

    def write(folder: Path) -> Path:
        (folder / name).symlink_to(target)
        return folder / name

    return write


def pipe(name: str) -> Bomb:
    """A pipe to which nothing is written."""

    def write(folder: Path) -> Path:
        os.mkfifo(folder / name)
        return folder / name

    return write


def stl(count: int, corner: float = 1.0) -> bytes:
    """A binary STL that says how many triangles it has, and holds three."""
    return (
        bytes(80) + struct.pack("<I", count) + struct.pack("<12fH", *[corner] * 12, 0)
    )


def bombs() -> dict[str, Bomb]:
    """Every bomb by name."""
    many = "".join(f"  o{k}: {{box: [1, 1, 1]}}\n" for k in range(20_000))
    doctype = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>'
    outside = {
        "up": "../../etc/x.stl",
        "absolute": "/etc/x.stl",
        "url": "file:///etc/x.stl",
        "package": "package://p/../../etc/x.stl",
        "escaped": "%2e%2e/%2e%2e/x.stl",
        "no name": "\\0",
        "long": "a" * 3000,
    }
    return {
        "yaml laughs": text("a.yaml", aliases("")),
        "yaml merges": text("a.yaml", aliases("<<")),
        "yaml itself": text("a.yaml", "robots: &a [*a]\n"),
        "yaml deep": text("a.yaml", "[" * 3_000),
        "yaml deeper": text("a.yaml", "{a: " * 100_000),
        "yaml dashes": text("a.yaml", "- " * 100_000),
        "yaml comment": text("a.yaml", "#" * 20_000_000),
        "yaml objects": text("a.yaml", SCENE + many),
        "yaml integer": text("a.yaml", SCENE + f"margin: {'9' * 3_900}\n"),
        "yaml date": text("a.yaml", "robots: 2001-99-99\n"),
        "yaml tag": text("a.yaml", "!!python/object/apply:os.system [ls]\n"),
        "yaml key": text("a.yaml", "? [a, {b: c}]\n: 1\n"),
        "yaml zero": link("a.yaml", "/dev/zero"),
        "yaml pipe": pipe("a.yaml"),
        "yaml secret": link("a.yaml", "/etc/passwd"),
        "yaml hole": long_file("a.yaml", 50_000_000_000),
        "motion deep": text("motion.json", "[" * 100_000),
        "motion merges": text("motion.yaml", aliases("<<")),
        "npz unpacks": archive("motion.npz", {"q.npy": bytes(1_600_000_000)}),
        "npz header": archive("motion.npz", {"q.npy": array_header("(10**12,)")}),
        "npz shape": archive("motion.npz", {"q.npy": array_header("(99999999999, 9)")}),
        "npz type": archive("motion.npz", {"q.npy": array_header("()", "<U999999999")}),
        "npz objects": archive("motion.npz", {"q.npy": array_header("(3,)", "|O")}),
        "npz hole": long_file("motion.npz", 10_000_000_000, b"PK\x03\x04"),
        "csv lines": text("motion.csv", "a\n" + "1\n" * 20_000_000),
        "csv cells": text("motion.csv", "1," * 20_000_000),
        "csv field": text("motion.csv", "a,b\n" + '"' + "1" * 200_000 + '",2\n'),
        "csv names": text("motion.csv", ",".join(f"j{k}" for k in range(200_000))),
        "csv hole": long_file("motion.csv", 10_000_000_000),
        "stl million": long_file("m.stl", 84 + 50 * 10**7, stl(10**7)[:84]),
        "stl lies": text("m.stl", stl(2**32 - 1)),
        "stl far": text("m.stl", stl(1, 1e30)),
        "stl no area": text("m.stl", stl(1)),
        "stl text": text("m.stl", "solid\n" + "facet normal 0 0 1\n" * 500_000),
        "ply count": text(
            "m.ply",
            "ply\nformat binary_little_endian 1.0\nelement vertex 99999999999\n"
            "property float x\nelement face 9999999999\n"
            "property list uchar int vertex_indices\nend_header\n",
        ),
        "obj faces": text("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * 10**6),
        "obj index": text("m.obj", "v 0 0 0\nf 1 999999999 -5\n"),
        "obj polygon": text("m.obj", "v 0 0 1\n" + "f" + " 1" * 5_000_000 + "\n"),
        "obj others": text("m.obj", "mtllib ../../../etc/passwd\nv 0 0 0\nf 1 1 1\n"),
        "dae entities": text("m.dae", f"{doctype}<COLLADA>&b;</COLLADA>"),
        "dae deep": text("m.dae", "<COLLADA>" + "<node>" * 100_000),
        "urdf entities": text("x.urdf", f"{doctype}<robot>&b;</robot>"),
        "urdf deep": text("x.urdf", "<robot>" + "<link>" * 100_000),
        "urdf links": text(
            "x.urdf", "<robot>" + '<link name="a"/>' * 200_000 + "</robot>"
        ),
        "urdf chain": text("x.urdf", chain(490)),
        "urdf name": text("x.urdf", f'<robot><link name="{"a" * 10**6}"/></robot>'),
        "urdf zero": link("x.urdf", "/dev/zero"),
        "urdf utf-16": text("x.urdf", f"{doctype}<robot>&b;</robot>".encode("utf-16")),
        "srdf strangers": text("x.srdf", strangers(20_000)),
        **{
            f"scene mesh {how}": text(
                "scene.yaml", f"{SCENE}  m: {{mesh: {{file: '{name}'}}}}\n"
            )
            for how, name in outside.items()
        },
        **{
            f"robot mesh {how}": text(
                "x.urdf", ARM.format(geometry=f'<mesh filename="{name}"/>')
            )
            for how, name in outside.items()
        },
    }


def chain(count: int) -> str:
    """A robot whose links all hang on each other."""
    links = "".join(f'<link name="l{k}">{COLLISION}</link>' for k in range(count))
    joints = "".join(
        f'<joint name="j{k}" type="fixed"><parent link="l{k}"/><child link="l{k + 1}"/>'
        "</joint>"
        for k in range(count - 1)
    )
    return f'<robot name="r">{links}{joints}</robot>'


COLLISION = f"<collision><geometry>{SPHERE}</geometry></collision>"


def strangers(count: int) -> str:
    """An SRDF of another robot."""
    rows = "".join(
        f'<disable_collisions link1="{"x" * 90}{k}" link2="b"/>' for k in range(count)
    )
    return f'<robot name="r">{rows}</robot>'


def seeds(folder: Path) -> list[Path]:
    """Good files of each kind, to be mutated."""
    (folder / "r.urdf").write_text(ARM.format(geometry=SPHERE))
    good = {
        "scene.yaml": SCENE.encode(),
        "x.urdf": ARM.format(geometry=SPHERE).encode(),
        "x.srdf": b'<robot name="r"><disable_collisions link1="a" link2="b" '
        b'reason="Never"/></robot>',
        "motion.csv": b"time,j\n0.0,0.1\n0.1,0.2\n0.2,0.3\n",
        "motion.yaml": b"joint_names: [j]\npoints:\n- {positions: [0.1], "
        b"time_from_start: {sec: 1, nanosec: 5}}\n",
        "m.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "m.stl": bytes(80)
        + struct.pack("<I", 1)
        + struct.pack("<12fH", *range(9), 9, 1, 7, 0),
        "m.ply": b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
        b"property float y\nproperty float z\nelement face 1\n"
        b"property list uchar int vertex_indices\nend_header\n"
        b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
    }
    paths = []
    for name, content in good.items():
        (folder / name).write_bytes(content)
        paths.append(folder / name)
    np.savez(folder / "motion.npz", names=np.array(["j"]), q=np.zeros((5, 1)))
    return [*paths, folder / "motion.npz"]


def mutated(content: bytes, rng: Rng) -> bytes:
    """Bytes with a few changes: turned, cut, doubled, or replaced by something odd."""
    odd = (b"nan", b"-inf", b"1e999", b"9" * 400, b"\x00", b"\xff\xfe", b"&a", b"<<: ",
           b"../", b"[" * 60, b"<", b'"', b"{", b"\n", b"0x", b"~")  # fmt: skip
    changed = bytearray(content)
    for _ in range(int(rng.integers(1, 6))):
        at = int(rng.integers(0, len(changed) + 1))
        to = min(len(changed), at + int(rng.integers(1, 30)))
        match int(rng.integers(0, 4)):
            case 0 if at < len(changed):
                changed[at] ^= 1 << int(rng.integers(0, 8))
            case 1:
                del changed[at:to]
            case 2:
                changed[at:at] = changed[at:to] * int(rng.integers(1, 40))
            case _:
                changed[at:to] = odd[int(rng.integers(0, len(odd)))]
    return bytes(changed)


def inputs(folder: Path, count: int, rng: Rng) -> Iterator[tuple[str, Path]]:
    """Bombs, then mutants, each in a folder of its own that is removed afterwards."""
    ground = folder / "good"
    ground.mkdir()
    good = [(path.name, path.read_bytes()) for path in seeds(ground)]
    robot = (ground / "r.urdf").read_bytes()
    known = list(bombs().items())
    for k in range(count):
        own = folder / f"{k}"
        own.mkdir()
        (own / "r.urdf").write_bytes(robot)
        if k < len(known):
            name, write = known[k]
            yield name, write(own)
        else:
            name, content = good[int(rng.integers(0, len(good)))]
            (own / name).write_bytes(mutated(content, rng))
            yield f"mutant {k} of {name}", own / name
        shutil.rmtree(own)


def run(count: int, seed: int) -> dict[str, Any]:
    """Throw so many inputs at the readers.

    Args:
        count: How many; the bombs first, then mutants of good files.
        seed: Of the mutants.

    Returns:
        Counts by how they ended, the peak of memory of one [MB], the longest [s], and
        the names of those that ended badly.
    """
    found: dict[str, Any] = {
        "tried": 0, "refused": 0, "accepted": 0, "signals": 0, "tracebacks": 0,
        "no_memory": 0, "peak_MB": 0.0, "longest_s": 0.0, "bad": [],
    }  # fmt: skip
    ends = {READ: "accepted", REFUSED: "refused", NO_MEMORY: "no_memory"}
    with tempfile.TemporaryDirectory() as name:
        for what, path in inputs(Path(name), count, np.random.default_rng(seed)):
            code, seconds, memory = ended(path)
            end = "signals" if code < 0 else ends.get(code, "tracebacks")
            found["tried"] += 1
            found[end] += 1
            if end not in ("accepted", "refused"):
                found["bad"].append(f"{what}: {end}")
            found["peak_MB"] = max(found["peak_MB"], round(memory, 1))
            found["longest_s"] = max(found["longest_s"], round(seconds, 2))
    return found
