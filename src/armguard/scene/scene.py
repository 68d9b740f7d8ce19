"""A scene: robots, objects, what may touch, what distance is to be kept."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from types import MappingProxyType
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError, UnknownNameError, did_you_mean
from armguard.geometry.pose import Pose
from armguard.robot.limits import home_configuration
from armguard.robot.model import RobotModel
from armguard.robot.stopping import StoppingFigures
from armguard.scene.gripping import Gripper
from armguard.scene.meshes import (
    MAX_TRIANGLES,
    MeshForm,
    MeshInput,
    Progress,
    mesh_parts,
)
from armguard.scene.objects import Part, SceneObject, riding_surface, scene_object
from armguard.scene.robots import (
    SceneRobot,
    check_figures,
    check_mode,
    load_robot,
    response_settings,
    scene_robot,
)
from armguard.scene.schema import checked
from armguard.scene.settings import (
    DEFAULT_MODE,
    CycleSettings,
    IndexSettings,
    Mode,
    ObjectKeys,
    ObjectSettings,
    ResponseName,
    ResponseSettings,
    RobotSettings,
)

__all__ = ["Allowance", "Scene", "SceneRobot", "check_mode", "response_settings"]

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

    a: str
    b: str
    reason: str


class Scene:
    """What is where, and what it must keep away from.

    Bodies are named 'robot/link', or by the object's name. Every pair of bodies in
    which something moves is checked, unless a rule says otherwise, with a reason.

    Args:
        mode: How the distance a robot must keep is made: "path", from its stopping
            figures and from where it may go while it stops; "speed", from its figures
            and its speed; "fixed", the number `buffer`.
        period: Time from one cycle to the next [s].
        late: How much later than that a cycle may come [s].
        buffer: Distance every pair must keep beyond the modelled surfaces, in "path"
            and "speed" beside what the figures ask for [m]. By default 5 mm for robots
            of these modes, the paper's 1.2 in for those of "fixed".
        margin: Signed distance up to which pairs are reported [m]; by default 20 mm
            more than the largest buffer.
        index: How near pairs are found.

    Raises:
        SceneError: A distance or a time is negative or not finite, or the mode is
            none.

    Example:
        >>> from armguard import Box, Pose, Scene
        >>> scene = Scene()
        >>> thing = scene.add(
        ...     Box(half_extents=(0.6, 1.0, 0.025)),
        ...     name="table",
        ...     pose=Pose(xyz=(0.5, 0, -0.03)),
        ... )
        >>> scene.body_names()
        ('table',)
    """

    def __init__(
        self,
        *,
        mode: Mode = DEFAULT_MODE,
        period: float = CycleSettings.period,
        late: float = CycleSettings.late,
        buffer: float | None = None,
        margin: float | None = None,
        index: IndexSettings | None = None,
    ) -> None:
        self.mode = check_mode("mode", mode)
        self.period = check_amount("period", period, "s")
        if period == 0.0:
            raise SceneError("period is 0 s; it must be > 0")
        self.late = check_amount("late", late, "s")
        self.buffer = None if buffer is None else check_amount("buffer", buffer)
        self._margin = None if margin is None else check_amount("margin", margin)
        self.index = IndexSettings() if index is None else index
        self._robots: dict[str, SceneRobot] = {}
        self._objects: dict[str, SceneObject] = {}
        self.allowances: list[Allowance] = []
        self.pair_buffers: dict[tuple[str, str], float] = {}
        self.notes: list[str] = []

    @property
    def robots(self) -> Mapping[str, SceneRobot]:
        """Robots by name, in the order they were added."""
        return MappingProxyType(self._robots)

    @property
    def objects(self) -> Mapping[str, SceneObject]:
        """Objects by name, in the order they were added."""
        return MappingProxyType(self._objects)

    @property
    def largest_buffer(self) -> float:
        """Largest distance any pair must keep [m]."""
        own = [
            *(self._robot_buffer(robot) for robot in self._robots.values()),
            *(self._object_buffer(thing) for thing in self._objects.values()),
        ]
        return max([self._mode_buffer(self.mode), *own, *self.pair_buffers.values()])

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

    def add_robot(
        self,
        urdf: str | Path | RobotModel,
        *,
        name: str,
        base: Pose | None = None,
        srdf: str | Path | None = None,
        packages: Mapping[str, Path] | None = None,
        buffer: float | None = None,
        mode: Mode | None = None,
        stopping: StoppingFigures | Mapping[str, Any] | None = None,
        response: ResponseName | ResponseSettings = RobotSettings.response,
        gripper: Gripper | None = None,
        fit_target: float = RobotSettings.fit_target,
        max_primitives: int = RobotSettings.max_primitives,
        home: Mapping[str, float] | None = None,
        progress: Progress | None = None,
    ) -> SceneRobot:
        """Add a robot.

        Args:
            urdf: A URDF file, a model, or the name of a robot such as "panda", which
                brings its SRDF and its stopping figures.
            name: Its name in the scene.
            base: Its root frame in the world.
            srdf: Its SRDF file.
            packages: Folders of `package://` names.
            buffer: Distance its links must keep; the scene's if None [m].
            mode: How the distance it must keep is made; the scene's mode if None.
            stopping: How it stops: figures, or what `stopping_figures` takes. Of a
                robot by name, what is not given is taken from its own figures.
            response: What it does about what is near, see `Guard.filter`.
            gripper: Its gripper, see docs/gripping.md.
            fit_target: Overreach the fitted primitives should stay below [m].
            max_primitives: Primitives a link may be given for that.
            home: Home positions by joint name; see `home_configuration` for the rest.
            progress: Called with what is done, its number and their count, while links
                are fitted.

        Raises:
            SceneError: The name is taken or no name.
            ModelError: The robot cannot be guarded as it is written.
            FiguresError: A figure cannot be true.
        """
        self._check_name(name)
        settings = RobotSettings(
            buffer=buffer,
            mode=self.mode if mode is None else mode,
            response=response_settings(f"robot '{name}'", response),
            gripper=gripper,
            fit_target=fit_target,
            max_primitives=max_primitives,
        )
        robot = scene_robot(
            name,
            load_robot(urdf, srdf, packages),
            checked(f"robot '{name}'", settings),
            base=base,
            stopping=stopping,
            home=home,
            progress=progress,
        )
        self._robots[name] = robot
        self.notes += [f"robot '{name}': {note}" for note in robot.model.notes]
        return robot

    def add(
        self,
        shapes: Part | Sequence[Part],
        *,
        name: str,
        pose: Pose | None = None,
        **settings: Unpack[ObjectKeys],
    ) -> SceneObject:
        """Add an object.

        Args:
            shapes: A shape or a surface, or several: their union.
            name: Its name.
            pose: Its frame in the world, or in the link it is attached to.
            settings: What it is beside, see `ObjectSettings`. `graspable` may be true
                or false, `rests_on` one name.

        Raises:
            SceneError: The name is taken or no name, there is no shape, a setting
                cannot be true, or settings and shapes contradict each other.
            UnknownNameError: The link does not exist.
        """
        self._check_name(name)
        kept = checked(f"object '{name}'", ObjectSettings(**dict[str, Any](settings)))
        if kept.attached_to is not None:
            self._check_body(kept.attached_to, link=True)
        parts = shapes if isinstance(shapes, Sequence) else (shapes,)
        self._objects[name] = scene_object(name, parts, pose, kept)
        return self._objects[name]

    def add_mesh(
        self,
        mesh: MeshInput,
        *,
        name: str,
        form: MeshForm = "triangles",
        pose: Pose | None = None,
        scale: float | Sequence[float] = 1.0,
        rounding: float = 0.0,
        max_triangles: int = MAX_TRIANGLES,
        progress: Progress | None = None,
        **settings: Unpack[ObjectKeys],
    ) -> SceneObject:
        """Add an object that is a mesh.

        Args:
            mesh: An STL, OBJ, PLY or DAE file, or vertices of shape (v, 3) [m] and
                faces of shape (n, 3).
            name: Its name.
            form: "triangles", its surface as it is; "hull", its convex hull;
                "pieces", several convex hulls that follow it, see `convex_pieces`.
            pose: Its frame in the world, or in the link it is attached to.
            scale: Factor from the mesh's numbers to metres, or one for each axis [-].
            rounding: Growth outwards on all sides [m].
            max_triangles: More than this many are refused.
            progress: Called with what is done, its number and their count, if it
                takes long.
            settings: See `add`.

        Raises:
            MeshError: The mesh cannot be read, or not be brought into this form.
            SceneError: See `add`.
            UnknownNameError: The link does not exist.

        Example:
            >>> from armguard import Scene
            >>> vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0.2)]
            >>> faces = [(0, 1, 2), (1, 3, 2)]
            >>> ramp = Scene().add_mesh((vertices, faces), name="ramp")
            >>> len(ramp.surfaces[0])
            2
        """
        self._check_name(name)
        link = settings.get("attached_to")
        if link is not None and form == "triangles":
            raise SceneError(riding_surface(name, link))
        parts = mesh_parts(
            mesh,
            form=form,
            scale=scale,
            rounding=rounding,
            max_triangles=max_triangles,
            progress=progress,
        )
        return self.add(parts, name=name, pose=pose, **settings)

    def remove(self, name: str) -> None:
        """Remove an object, and the rules about it.

        Raises:
            UnknownNameError: No object has that name.
        """
        if name not in self._objects:
            raise UnknownNameError(
                f"no object is named '{name}'; {did_you_mean(name, self._objects)}"
            )
        del self._objects[name]
        self.allowances = [a for a in self.allowances if name not in (a.a, a.b)]
        for pair in [p for p in self.pair_buffers if name in p]:
            del self.pair_buffers[pair]

    def set_margin(self, margin: float | None) -> None:
        """Change up to which signed distance pairs are reported.

        Args:
            margin: That distance; 20 mm more than the largest buffer if None [m].

        Raises:
            SceneError: It is negative or not finite.
        """
        self._margin = None if margin is None else check_amount("margin", margin)

    def set_mode(self, mode: Mode, robot: str | None = None) -> None:
        """Change how the distance that robots must keep is made.

        Args:
            mode: The mode.
            robot: The robot it is for; all, and those still to come, if None.

        Raises:
            SceneError: There is no such mode.
            UnknownNameError: There is no such robot.
        """
        check_mode("mode", mode)
        names = self._named(robot)
        if robot is None:
            self.mode = mode
        for name in names:
            self._robots[name] = replace(self._robots[name], mode=mode)

    def set_response(
        self, response: ResponseName | ResponseSettings, robot: str | None = None
    ) -> None:
        """Change what robots do about what is near.

        Args:
            response: The response, or its settings.
            robot: The robot it is for; all if None.

        Raises:
            SceneError: A setting is out of range.
            UnknownNameError: There is no such robot.
        """
        for name in self._named(robot):
            chosen = response_settings(f"robot '{name}'", response)
            self._robots[name] = replace(self._robots[name], response=chosen)

    def set_stale(self, stale: float) -> None:
        """Change how old states of all robots may be before they are not believed.

        A state costs the distance of the age it has, however old it might have been.

        Args:
            stale: The age [s].

        Raises:
            SceneError: It is no time, or states of a robot are never that fresh.
        """
        if not (isfinite(stale) and stale > 0.0):
            raise SceneError(f"stale is {stale} s; it must be finite and > 0")
        for name, robot in self._robots.items():
            if robot.stopping is not None and stale < robot.stopping.sensing:
                raise SceneError(
                    f"stale is {stale} s, less than it takes to measure robot "
                    f"'{name}', {robot.stopping.sensing} s"
                )
        for name, robot in self._robots.items():
            if robot.stopping is not None:
                stopping = replace(robot.stopping, stale=stale)
                self._robots[name] = replace(robot, stopping=stopping)

    def set_home(self, name: str, home: Mapping[str, float]) -> None:
        """Give a robot another home configuration.

        Args:
            name: The robot.
            home: Positions by joint name; see `home_configuration` for the rest.

        Raises:
            ModelError: A joint does not exist, or is outside its limits.
        """
        robot = self._robots[name]
        self._robots[name] = replace(robot, home=home_configuration(robot.model, home))

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
        """Set the distance a pair must keep, in place of what its sides ask for.

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

    def buffer_of(self, body: str) -> float:
        """Distance a body must keep where no pair rule says otherwise [m].

        Its own, else the scene's, else that of its robot's mode; of an object the
        smaller as soon as one robot is not "fixed", since the larger of a pair counts.
        """
        if body in self._objects:
            return self._object_buffer(self._objects[body])
        return self._robot_buffer(self._robots[body.split("/", 1)[0]])

    def _robot_buffer(self, robot: SceneRobot) -> float:
        if robot.buffer is not None:
            return robot.buffer
        return self._mode_buffer(robot.mode)

    def _object_buffer(self, thing: SceneObject) -> float:
        if thing.buffer is not None:
            return thing.buffer
        near = (
            list(self._robots.values())
            if thing.attached_to is None
            else [self._robots[thing.attached_to.split("/", 1)[0]]]
        )
        modes = {robot.mode for robot in near} or {self.mode}
        return min(map(self._mode_buffer, modes))

    def _mode_buffer(self, mode: Mode) -> float:
        if self.buffer is not None:
            return self.buffer
        return PAPER_BUFFER if mode == "fixed" else FLOOR

    def validate(self) -> None:
        """Check what only the whole scene can tell.

        Raises:
            SceneError: There is no robot, a robot has no stopping figures, or a
                buffer exceeds the margin.
            UnknownNameError: What an object may rest on does not exist.
        """
        if not self._robots:
            raise SceneError("the scene has no robot; add one with `add_robot`")
        if not self.q_names:
            raise SceneError("no robot of the scene has a joint that moves")
        for robot in self._robots.values():
            check_figures(robot)
        for thing in self._objects.values():
            for support in thing.rests_on or ():
                self._check_body(support)
        if self.largest_buffer > self.margin:
            raise SceneError(
                f"a buffer of {self.largest_buffer * 1e3:.1f} mm is larger than the "
                f"margin of {self.margin * 1e3:.1f} mm, so a pair would stop the arm "
                "before it is reported; raise `margin` or leave it out"
            )

    def _named(self, robot: str | None) -> list[str]:
        if robot is None:
            return list(self._robots)
        if robot not in self._robots:
            raise UnknownNameError(
                f"no robot is named '{robot}'; {did_you_mean(robot, self._robots)}"
            )
        return [robot]

    def _check_name(self, name: str) -> None:
        if not name or "/" in name or name != name.strip():
            raise SceneError(
                f"'{name}' is no name; it must not be empty, hold '/', or start or end "
                "in a blank"
            )
        if name in self._robots or name in self._objects:
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


def check_amount(what: str, value: float, unit: str = "m") -> float:
    """Return a distance or a time that is finite and not negative.

    Raises:
        SceneError: It is not.
    """
    if not (isfinite(value) and value >= 0.0):
        raise SceneError(f"{what} is {value} {unit}; it must be finite and >= 0")
    return float(value)
