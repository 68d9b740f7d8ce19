"""Draw the pictures of the bay.

`python benchmarks/draw_bay.py` writes `docs/images/bay*.png`. Poses and witness points
come from pinocchio and coal (`bay_oracle.py`), the picture from casting rays
(`ray_picture.py`).
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl

from bay_oracle import BayOracle, Floats, Nearest
from make_bay_tasks import (
    HANDLED,
    TASKS,
    Keyframe,
    configurations,
    distance_of,
    kind_of,
)
from ray_picture import Camera, Solid, render

mpl.use("agg")

import matplotlib.pyplot as plt

IMAGES = Path(__file__).parents[1] / "docs/images"

# After Okabe and Ito's palette, lighter: colour-blind eyes can distinguish them.
LEFT, RIGHT, OBJECT, FIXTURE = "#2F8FD0", "#E8743B", "#2FB38A", "#C3CAD2"
BUFFER, INK = "#F2A900", "#1F2933"

# Pixels of a figure's inch.
DPI = 100

BAY = Camera((-0.07, -0.11, 0.84), -146.0, 26.0, 5.0, 2.56, 740, 610)


def solids_of(
    oracle: BayOracle, q: Floats, pair: Nearest | None = None, *, alone: bool = False
) -> list[Solid]:
    """All primitives, and the buffers of the moving sides of a pair.

    Args:
        oracle: The bay.
        q: Positions of both arms, shape (14,) [rad].
        pair: The pair whose moving sides get their buffers.
        alone: Leave out what is neither an arm nor in the pair.
    """
    found = []
    growth, names = float(oracle.scene["buffer"]), () if pair is None else pair[1:3]
    for primitive, frame in zip(oracle.primitives, oracle.placements(q), strict=True):
        if alone and not primitive.moves and primitive.body not in names:
            continue
        colour = mpl.colors.to_rgb(colour_of(primitive.body))
        solid = Solid(primitive.size, frame.rotation, frame.translation, colour)
        found.append(solid)
        if primitive.moves and primitive.body in names:
            radius, *length = primitive.size
            size, shell = (radius + growth, *length), mpl.colors.to_rgb(BUFFER)
            found.append(replace(solid, size=size, colour=shell, shell=True))
    return found


def colour_of(body: str) -> str:
    """Left arm, right arm, handled object, or fixture."""
    if "/" in body:
        return LEFT if body.startswith("left/") else RIGHT
    return OBJECT if body in HANDLED else FIXTURE


def closest(
    oracle: BayOracle, task: Sequence[Keyframe], kind: str
) -> tuple[Floats, Nearest]:
    """Configuration and pair of a task's nearest approach of a kind."""
    rows = configurations(oracle.home, task)
    pairs = [
        min((p for p in oracle.measure(q) if kind_of(p) == kind), key=distance_of)
        for q in rows
    ]
    k = min(range(len(rows)), key=lambda i: pairs[i].distance)
    return rows[k], pairs[k]


def show(figure: Any, picture: Floats, camera: Camera, left: float) -> Any:
    """A picture in a figure, pixel for pixel, `left` pixels from its left edge."""
    width, height = figure.get_size_inches() * DPI
    bottom = height - camera.height_px
    axes = figure.add_axes(
        (left / width, bottom / height, camera.width_px / width,
         camera.height_px / height)
    )  # fmt: skip
    axes.imshow(picture, interpolation="nearest")
    axes.set_axis_off()
    return axes


def mark_witness(axes: Any, camera: Camera, pair: Nearest, size: float) -> None:
    """The two witness points and the line between them."""
    x, y = zip(*(camera.pixel(p) for p in (pair.point_a, pair.point_b)), strict=True)
    axes.plot(x, y, color=INK, linewidth=size / 4, marker="o", markersize=size,
              markerfacecolor="white", markeredgecolor=INK,
              markeredgewidth=size / 4)  # fmt: skip


def legend(figure: Any, *, with_buffer: bool) -> None:
    """What the colours mean."""
    entries = [
        (LEFT, "left arm"),
        (RIGHT, "right arm"),
        (OBJECT, "objects to handle"),
        (FIXTURE, "fixtures"),
    ]
    if with_buffer:
        entries.append((BUFFER, "safety buffer, 30.48 mm"))
    figure.legend(
        handles=[mpl.patches.Patch(color=c, label=text) for c, text in entries],
        loc="lower center", ncols=len(entries), frameon=False, fontsize=11,
        labelcolor=INK, handlelength=1.0, columnspacing=1.8,
    )  # fmt: skip


def draw_home(oracle: BayOracle) -> None:
    """The bay with both arms at home."""
    camera = replace(BAY, width_px=900)
    figure = plt.figure(figsize=(9, 6.6), dpi=DPI)
    show(figure, render(solids_of(oracle, oracle.home), camera), camera, 0)
    legend(figure, with_buffer=False)
    save(figure, "bay_home.png")


def draw_approach(
    oracle: BayOracle, q: Floats, pair: Nearest, near: Camera, name: str
) -> None:
    """The bay at an approach, and its nearest pair from near by."""
    figure = plt.figure(figsize=(12, 6.6), dpi=DPI)
    whole = show(figure, render(solids_of(oracle, q, pair), BAY), BAY, 0)
    solids = solids_of(oracle, q, pair, alone=True)
    detail = show(figure, render(solids, near), near, BAY.width_px)
    mark_witness(detail, near, pair, 8.0)
    frame_detail(figure, whole, detail, near, pair)
    legend(figure, with_buffer=True)
    save(figure, name)


def frame_detail(
    figure: Any, whole: Any, detail: Any, near: Camera, pair: Nearest
) -> None:
    """A ring round the place in the whole bay, and a title over the detail."""
    middle = (pair.point_a + pair.point_b) / 2
    whole.add_patch(
        mpl.patches.Circle(BAY.pixel(middle), 34, fill=False, color=INK, linewidth=1.4)
    )
    detail.text(
        near.width_px / 2, 28, f"{pair.a} to {pair.b}: {pair.distance * 1e3:.1f} mm",
        ha="center", va="center", color=INK, fontsize=13, weight="bold",
        bbox={"boxstyle": "round,pad=0.4", "color": "white", "alpha": 0.85},
    )  # fmt: skip
    detail.add_patch(
        mpl.patches.Rectangle((0, 0), near.width_px - 1, near.height_px - 1,
                              fill=False, color=INK, linewidth=1.4)
    )  # fmt: skip


def save(figure: Any, name: str) -> None:
    """Write a picture; nothing in the file says when or by what it was made."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    figure.savefig(IMAGES / name, facecolor="white", metadata={"Software": None})
    plt.close(figure)


def main() -> None:
    """Draw all pictures."""
    oracle = BayOracle()
    draw_home(oracle)
    for task, kind, azimuth, elevation, name in (
        (TASKS[700], "arm-arm", -150.0, 50.0, "bay.png"),
        (TASKS[150], "arm-fixture", -55.0, 12.0, "bay_150.png"),
        (TASKS[2000], "arm-object", -100.0, 15.0, "bay_2000.png"),
    ):
        q, pair = closest(oracle, task, kind)
        x, y, z = map(float, (pair.point_a + pair.point_b) / 2)
        near = Camera((x, y, z), azimuth, elevation, 1.1, 0.34, 450, 590)
        draw_approach(oracle, q, pair, near, name)


if __name__ == "__main__":
    main()
