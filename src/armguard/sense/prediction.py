"""Distances that a sensor has to measure, and those that are explained."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.scene.sensors import SceneSensor
from armguard.sense.frames import Frame
from armguard.sense.ranging import cast, touching
from armguard.sense.view import View
from armguard.sense.world import Placed, World

Ints = NDArray[np.int32]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


# Overreach of a primitive from which on its edge is not that of its surface [m].
OVERREACH = 0.003


class Mount(NamedTuple):
    """Where a sensor is at a time.

    Attributes:
        R: Its axes in the world, by columns, shape (3, 3).
        origin: Its place, shape (3,) [m].
        shift: How far off that may be by the joint positions [m].
        turn: By what angle it may be turned by them [rad].
    """

    R: Floats
    origin: Floats
    shift: float
    turn: float


class Prediction(NamedTuple):
    """Depths that zones have to measure, by the links and objects at a time.

    Attributes:
        near: Least depth over the rays of each zone, infinite without any, shape
            (z,) [m].
        far: Greatest one, infinite where one ray meets none, shape (z,) [m].
        primitive: Primitive that all rays of a zone meet; -1 if they meet several, or
            if one meets none, shape (z,).
        overreach: How far the primitives that are met may reach beyond the surfaces
            that they enclose, shape (z,) [m].
    """

    near: Floats
    far: Floats
    primitive: Ints
    overreach: Floats


def mount_of(sensor: SceneSensor, world: World, placed: Placed) -> Mount:
    """Where a sensor is at the time of placed primitives."""
    T = sensor.pose.matrix()
    if sensor.on is None:
        return Mount(T[:3, :3], T[:3, 3], 0.0, 0.0)
    frame = world.tables.links[sensor.on]
    in_body = frame.T_body_link @ T
    T = np.eye(4)
    T[:3] = placed.T[0, frame.body].reshape(3, 4)
    T = T @ in_body
    point = np.append(in_body[:3, 3], 0.0)[None]
    shift = world.spread(placed, np.array([frame.body], dtype=np.int32), point)[0, 4]
    return Mount(T[:3, :3], T[:3, 3], float(shift), world.turn(placed, frame.body))


def predict(view: View, mount: Mount, placed: Placed, world: World) -> Prediction:
    """Depths of the predicted zones of a sensor.

    Args:
        view: The sensor.
        mount: Where it is.
        placed: The primitives.
        world: The scene.
    """
    zones, rays, _ = view.ways.shape
    ways = view.ways.reshape(-1, 3)
    out = np.zeros((len(ways), 2))
    reach = 2.0 * view.sensor.range[1]
    kinds, rows, balls = world.kinds, placed.rows, placed.balls
    cast(mount.origin, ways @ mount.R.T, kinds, rows, balls, reach, out)
    depth = (out[:, 0] * ways[:, 2]).reshape(zones, rays)
    which = out[:, 1].reshape(zones, rays).astype(np.int32)
    same = (which == which[:, :1]).all(axis=1)
    errors = np.where(which >= 0, world.model_errors[which], 0.0)
    return Prediction(
        depth.min(axis=1), depth.max(axis=1), np.where(same, which[:, 0], -1),
        errors.max(axis=1),
    )  # fmt: skip


def explained(
    view: View, mount: Mount, placed: Placed, kinds: Ints, frame: Frame,
    prediction: Prediction,
) -> Bools:  # fmt: skip
    """Zones whose distances links or modelled objects explain, shape (rows, columns).

    One is explained if its area at the measured depth comes near to a primitive, or if
    it is beside an edge: a reading between two surfaces, or between one and what is not
    modelled, may be of both.

    Args:
        view: An array of zones.
        mount: Where it is.
        placed: The primitives.
        kinds: ShapeKind of each, shape (p,).
        frame: The frame.
        prediction: What it has to measure.
    """
    boxes, chosen = view.patches(frame, mount.R, mount.origin)
    depth = frame.depth[chosen]
    slack = view.slack(depth) + mount.shift + mount.turn * depth
    found = np.zeros(len(boxes), dtype=np.int32)
    touching(
        boxes, kinds, placed.rows, placed.balls,
        slack[:, None] + placed.shifts, found,
    )  # fmt: skip
    parts = np.stack([-prediction.near, prediction.far, prediction.overreach])
    near, far, overreach = about(parts.reshape(3, *frame.depth.shape))[:, chosen]
    near = -near
    merged = np.minimum(far + slack, near + view.sensor.merge)
    # A surface may end before the primitive that encloses it.
    over = overreach > OVERREACH
    merged = np.where(over, near + view.sensor.merge, merged)
    edge = (over | (far > near + slack)) & (near - slack <= depth) & (depth <= merged)
    out = np.zeros(frame.depth.shape, dtype=np.bool_)
    out[chosen] = (found >= 0) | edge
    return out


def about(values: Floats) -> Floats:
    """The greatest value of each zone and those beside it, shape (n, rows, columns)."""
    wide = np.pad(values, ((0, 0), (1, 1), (1, 1)), constant_values=-np.inf)
    rows = np.maximum(np.maximum(wide[:, :-2], wide[:, 1:-1]), wide[:, 2:])
    return np.asarray(
        np.maximum(np.maximum(rows[..., :-2], rows[..., 1:-1]), rows[..., 2:])
    )
