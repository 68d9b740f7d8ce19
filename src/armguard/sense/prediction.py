"""Distances that a sensor has to measure, and those that are explained."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.scene.sensors import SceneSensor
from armguard.sense.explaining import explain
from armguard.sense.frames import Frame
from armguard.sense.ranging import cast, over_zones
from armguard.sense.view import View
from armguard.sense.world import Placed, World

Ints = NDArray[np.int32]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


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

    @property
    def figures(self) -> Floats:
        """Axes by rows, place, shift and turn, shape (14,)."""
        out = np.empty(14)
        out[:9], out[9:12] = self.R.reshape(9), self.origin
        out[12], out[13] = self.shift, self.turn
        return out


class Prediction(NamedTuple):
    """Depths that zones have to measure, by the links and objects at a time.

    Attributes:
        zones: Of each zone, shape (z, 4): the least depth over its rays, infinite
            without any [m]; the greatest one, infinite where one ray meets none [m];
            the primitive that all rays meet, -1 if they meet several, or if one meets
            none; and how far the primitives that are met may reach beyond the surfaces
            that they enclose [m].
    """

    zones: Floats

    @property
    def near(self) -> Floats:
        """Least depths, shape (z,) [m]."""
        return self.zones[:, 0]

    @property
    def far(self) -> Floats:
        """Greatest depths, shape (z,) [m]."""
        return self.zones[:, 1]

    @property
    def primitive(self) -> Ints:
        """Primitives, shape (z,)."""
        return self.zones[:, 2].astype(np.int32)

    @property
    def overreach(self) -> Floats:
        """How far they may reach beyond their surfaces, shape (z,) [m]."""
        return self.zones[:, 3]


def mount_of(sensor: SceneSensor, world: World, placed: Placed) -> Mount:
    """Where a sensor is at the time of placed primitives."""
    T = sensor.pose.rows().reshape(3, 4)
    if sensor.on is None:
        return Mount(T[:, :3].copy(), T[:, 3].copy(), 0.0, 0.0)
    frame = world.tables.links[sensor.on]
    in_body = frame.T_body_link @ np.vstack([T, (0.0, 0.0, 0.0, 1.0)])
    T = placed.T[0, frame.body].reshape(3, 4) @ in_body
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
    found, out = np.empty((len(ways), 2)), np.empty((zones, 4))
    reach = 2.0 * view.sensor.range[1]
    kinds, rows, balls = world.kinds, placed.rows, placed.balls
    cast(mount.origin, ways @ mount.R.T, kinds, rows, balls, reach, found)
    over_zones(found, view.along, world.model_errors, rays, out)
    return Prediction(out)


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
    out = np.empty(frame.depth.shape, dtype=np.bool_)
    zones = prediction.zones.reshape(*out.shape, 4)
    rows, balls = placed.rows, placed.balls
    explain(frame.depth, zones, view.figures, mount.figures, kinds, rows, balls, out)
    return out
