"""Robots and objects of a scene by name, and the distances they must keep."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite
from numbers import Real
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import (
    SceneError,
    UnknownNameError,
    did_you_mean,
    known_names,
)
from armguard.geometry.pose import Pose
from armguard.scene.objects import SceneObject
from armguard.scene.robots import SceneRobot, check_mode
from armguard.scene.schema import (
    BRIEF,
    CLOSED,
    MOST_MARGIN,
    MOST_METRES,
    Name,
    checked,
    in_other_units,
)
from armguard.scene.sensing import (
    SENSED,
    UNSEEN,
    ReflexSettings,
    SceneSensing,
    SceneZone,
    check_reflex_sensor,
    scene_sensing,
)
from armguard.scene.sensors import SceneSensor, SensorSettings, scene_sensors
from armguard.scene.settings import Mode

# The paper's fixed buffer, 1.2 inches beyond the modelled boundary [m].
PAPER_BUFFER = 0.03048

# What stays to be kept where stopping figures make the buffer, at rest too [m].
FLOOR = 0.005

# Pairs are reported from this far beyond the largest buffer on, unless the scene says
# otherwise: the operator sees a pair before it stops the arm [m].
MARGIN_BEYOND_BUFFER = 0.02


@dataclass(frozen=True, slots=True)
class Allowance:
    """A pair of bodies that may touch.

    Attributes:
        a: One body.
        b: The other.
        reason: Why.
    """

    __pydantic_config__ = CLOSED

    a: str
    b: str
    reason: Name


class Contents:
    """Bodies of a scene, and what every pair of them must keep.

    Args:
        mode: How the distance a robot must keep is made.
        buffer: Distance every pair must keep; that of the mode if None [m].
        margin: Signed distance up to which pairs are reported; from the largest buffer
            if None [m].

    Raises:
        SceneError: A distance is negative or not finite, or the mode is none.
    """

    def __init__(self, mode: Mode, buffer: float | None, margin: float | None) -> None:
        self.mode = check_mode("mode", mode)
        self.buffer = None if buffer is None else check_amount("buffer", buffer)
        self.set_margin(margin)
        self._robots: dict[str, SceneRobot] = {}
        self._objects: dict[str, SceneObject] = {}
        self.strange_count = 0  # objects whose lengths look like millimetres
        self.allowances: list[Allowance] = []
        self.pair_buffers: dict[tuple[str, str], float] = {}
        self._sensors: dict[str, SceneSensor] = {}
        self._sensor_entries: dict[str, tuple[str, ...]] = {}  # sensors of each entry
        self.reflex: ReflexSettings | None = None
        self.sensing: SceneSensing | None = None

    @property
    def sensors(self) -> Mapping[str, SceneSensor]:
        """Sensors by name; no verdict depends on them."""
        return MappingProxyType(self._sensors)

    @property
    def robots(self) -> Mapping[str, SceneRobot]:
        """Robots by name, in the order they were added."""
        return MappingProxyType(self._robots)

    @property
    def objects(self) -> Mapping[str, SceneObject]:
        """Objects by name, in the order they were added."""
        return MappingProxyType(self._objects)

    @property
    def q_names(self) -> tuple[str, ...]:
        """'robot/joint' of each place of q: robots as added, joints as in the URDF."""
        return tuple(
            f"{name}/{joint}"
            for name, robot in self._robots.items()
            for joint in robot.model.q_names
        )

    @property
    def home(self) -> NDArray[np.float64]:
        """Home configuration, shape (n,) [rad or m]."""
        return np.array(
            [
                robot.home[joint]
                for robot in self._robots.values()
                for joint in robot.model.q_names
            ],
            dtype=np.float64,
        )

    def body_names(self) -> tuple[str, ...]:
        """Names of all bodies: 'robot/link', then objects."""
        links = (
            f"{name}/{link}"
            for name, robot in self._robots.items()
            for link in robot.model.links
        )
        return (*links, *self._objects)

    @property
    def largest_buffer(self) -> float:
        """Largest distance any pair must keep [m]."""
        own = map(self.buffer_of, (*self._robots, *self._objects))
        return max([self._usual({self.mode}), *own, *self.pair_buffers.values()])

    @property
    def margin(self) -> float:
        """Signed distance up to which pairs are reported [m]."""
        if self._margin is not None:
            return self._margin
        # What pushes a robot has to be seen from where its push begins.
        farthest = max(
            (
                r.response.influence
                for r in self._robots.values()
                if r.response.kind == "field"
            ),
            default=0.0,
        )
        return self.largest_buffer + max(MARGIN_BEYOND_BUFFER, farthest)

    def set_margin(self, margin: float | None) -> None:
        """Change up to which signed distance pairs are reported.

        Args:
            margin: That distance; 20 mm more than the largest buffer if None [m].

        Raises:
            SceneError: It is negative or not finite.
        """
        self._margin = (
            None
            if margin is None
            else check_amount("margin", margin, greatest=MOST_MARGIN)
        )

    def set_mode(self, mode: Mode, robot: str | None = None) -> None:
        """Change how the distance that robots must keep is made.

        Args:
            mode: The mode.
            robot: The robot it is for; all, and those added later, if None.

        Raises:
            SceneError: There is no such mode.
            UnknownNameError: There is no such robot.
        """
        check_mode("mode", mode)
        names = self._named(robot)
        if robot is None:
            self.mode = mode
        for name in names:
            self._change(name, mode=mode)

    def allow(self, a: str, b: str, *, reason: str) -> None:
        """Leave a pair of bodies unchecked.

        Args:
            a: 'robot/link' or an object's name.
            b: The other body.
            reason: Why; it is reported with the pair.

        Raises:
            SceneError: There is no reason, or the pair is one body.
            UnknownNameError: A body does not exist.
        """
        self._check_body(a)
        self._check_body(b)
        if a == b:
            raise SceneError(f"'{a}' is allowed to touch itself; name two bodies")
        if not reason.strip():
            raise SceneError(f"'{a}' may touch '{b}' without a reason; give one")
        self.allowances.append(Allowance(a, b, reason.strip()))

    def set_buffer(self, a: str, b: str, value: float) -> None:
        """Set the distance a pair must keep, in place of the buffers of its sides.

        Args:
            a: A body, or a robot's name for all its links.
            b: The other.
            value: Distance [m].

        Raises:
            SceneError: The value is negative or not finite.
            UnknownNameError: A name does not exist.
        """
        check_amount(f"buffer of '{a}' and '{b}'", value)
        for x in self._bodies_of(a):
            for y in self._bodies_of(b):
                if x != y:
                    self.pair_buffers.pop((y, x), None)
                    self.pair_buffers[x, y] = value

    def add_sensor(
        self, name: str, *, pose: Pose | None = None, **settings: Any
    ) -> tuple[SceneSensor, ...]:
        """Add a sensor, or a ring of sensors.

        Args:
            name: Its name; sensor k of a ring is 'NAME/k'.
            pose: Its frame, or that of the middle of the ring, in the link that carries
                it or in the world.
            settings: See `SensorSettings`.

        Raises:
            SceneError: The name is taken or no name, or a setting cannot be true.
            UnknownNameError: The link does not exist.
        """
        self._check_name(name)
        given = checked(f"sensor '{name}'", settings, kind=SensorSettings)
        if given.on is not None:
            self._check_body(given.on, link=True)
        made = tuple(scene_sensors(name, given, pose or Pose()))
        self._sensor_entries[name] = tuple(one.name for one in made)
        self._sensors |= {one.name: one for one in made}
        return made

    def set_reflex(self, **settings: Any) -> None:
        """Declare the reflex that stops the arms by sensors.

        Args:
            settings: See `ReflexSettings`. The name of a ring is all of its sensors.

        Raises:
            SceneError: A setting cannot be true, or no zone can see so far.
            UnknownNameError: There is no such sensor.
        """
        reflex = checked("reflex", settings, kind=ReflexSettings)
        names: list[str] = []
        known = {*self._sensors, *self._sensor_entries}
        for name in reflex.sensors:
            if name not in known:
                near = did_you_mean(name, known)
                raise UnknownNameError(f"no sensor is named '{name}'; {near}")
            names += self._sensor_entries.get(name, (name,))
        for name in names:
            check_reflex_sensor(self._sensors[name], reflex.distance)
        self.reflex = replace(reflex, sensors=tuple(dict.fromkeys(names)))

    def set_sensing(
        self, *, zones: Mapping[str, SceneZone] | None = None, **settings: Any
    ) -> None:
        """Declare the space that sensors look at, for `Guard.update_cells`.

        Args:
            zones: Zones by name; in several at once the first one counts.
            settings: See `SensingSettings`; `region`, `unknown` and `intruder` are
                required.

        Raises:
            SceneError: A setting cannot be true, or unseen space is free without a
                reason.

        Example:
            >>> from armguard import Scene
            >>> scene = Scene()
            >>> scene.set_sensing(
            ...     region={"centre": (0.4, 0, 0.6)},
            ...     unknown="still",
            ...     intruder={"speed": 1.6, "size": 0.05},
            ... )
            >>> scene.sensing.edge
            2.56
        """
        self.sensing = scene_sensing(settings, zones or {})

    def buffer_of(self, body: str) -> float:
        """Distance a body must keep where no pair rule says otherwise [m].

        Its own, else the scene's, else that of its robot's mode; of an object the
        smaller as soon as one robot is not "fixed", since the larger of a pair counts.

        Args:
            body: 'robot/link', a robot, an object, or `SENSED`.
        """
        item = self._objects.get(body)
        carrier = body if item is None else item.attached_to
        if body == SENSED:
            carrier = None
        near = list(self._robots.values())
        if carrier is not None:
            near = [self._robots[carrier.split("/", 1)[0]]]
        own = None if carrier is None else near[0].buffer
        own = own if item is None else item.buffer
        return self._usual({robot.mode for robot in near}) if own is None else own

    def _usual(self, modes: set[Mode]) -> float:
        """Distance that a body of no own buffer keeps near robots of modes [m]."""
        if self.buffer is not None:
            return self.buffer
        return PAPER_BUFFER if (modes or {self.mode}) == {"fixed"} else FLOOR

    def _change(self, robot: str, **settings: Any) -> None:
        self._robots[robot] = replace(self._robots[robot], **settings)

    def _named(self, robot: str | None) -> list[str]:
        if robot is None:
            return list(self._robots)
        if robot not in self._robots:
            raise UnknownNameError(
                f"no robot is named '{robot}'; {known_names(self._robots)}"
            )
        return [robot]

    def _check_name(self, name: str) -> None:
        if not isinstance(name, str):
            raise SceneError(
                f"the name is {BRIEF.repr(name)}; it must be text, as in "
                "add(Box(size=(1, 1, 1)), 'table')"
            )
        if not name or "/" in name or name != name.strip():
            raise SceneError(
                f"'{name}' is no name; it must not be empty, hold '/', or start or end "
                "in a blank"
            )
        taken = (self._robots, self._objects, self._sensor_entries, (SENSED, UNSEEN))
        if any(name in one for one in taken):
            raise SceneError(f"the name '{name}' is taken; give another")

    def _check_body(self, body: str, *, link: bool = False) -> None:
        known = [n for n in self.body_names() if not link or "/" in n]
        if body in known:
            return
        if body in self._robots:
            raise UnknownNameError(
                f"'{body}' is a robot; name one of its links, such as "
                f"'{body}/{next(iter(self._robots[body].model.links))}'"
            )
        what = "link" if link else "body"
        raise UnknownNameError(
            f"no {what} is named '{body}'; {did_you_mean(body, known)}"
        )

    def _bodies_of(self, name: str) -> list[str]:
        if name in self._robots:
            return [f"{name}/{link}" for link in self._robots[name].model.links]
        self._check_body(name)
        return [name]


def check_amount(
    what: str, value: float, unit: str = "m", greatest: float = MOST_METRES
) -> float:
    """Return a distance or a time that is finite, not negative and not too large.

    Raises:
        SceneError: It is not, or it is no number.
    """
    given: object = value
    if isinstance(given, bool) or not isinstance(given, Real):
        raise SceneError(f"{what} is {given!r}; it must be a number [{unit}]")
    if not (isfinite(value) and value >= 0.0):
        raise SceneError(f"{what} is {value} {unit}; it must be finite and >= 0")
    if value > greatest:
        raise SceneError(f"{what} {in_other_units(float(value), unit)}")
    return float(value)
