"""A scene: robots, objects, what may touch, what distance is to be kept."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice
from math import isfinite
from pathlib import Path
from typing import Any, Unpack

from armguard.errors import SceneError, UnknownNameError, did_you_mean
from armguard.geometry.pose import Pose
from armguard.notebook import html_table
from armguard.robot.limits import home_configuration
from armguard.robot.model import RobotModel
from armguard.robot.stopping import StoppingFigures
from armguard.scene.contents import Contents, check_amount
from armguard.scene.meshes import (
    MAX_TRIANGLES,
    MeshForm,
    MeshInput,
    Progress,
    mesh_parts,
)
from armguard.scene.objects import (
    NAMED_STRANGE,
    Part,
    SceneObject,
    riding_surface,
    scene_object,
    shapes_in_words,
    strange_lengths,
    warn_of_length,
)
from armguard.scene.region import check_modes, check_region
from armguard.scene.robots import (
    SceneRobot,
    check_figures,
    fast_joints,
    fitted,
    load_robot,
    response_settings,
    scene_robot,
)
from armguard.scene.schema import LEAST_UNLIKELY, checked
from armguard.scene.settings import (
    DEFAULT_MODE,
    CycleSettings,
    FitKeys,
    IndexSettings,
    Mode,
    ObjectKeys,
    ObjectSettings,
    ResponseName,
    ResponseSettings,
    RobotKeys,
    RobotSettings,
)

__all__ = ["Scene", "SceneRobot", "response_settings"]

# An object of which nothing is said.
PLAIN = ObjectSettings()

log = logging.getLogger("armguard")


class Scene(Contents):
    """Robots, objects, and the distances that they must keep.

    Bodies are named 'robot/link', or by the object's name. Every pair of bodies in
    which something moves is checked, unless a rule says otherwise, with a reason.

    Args:
        mode: How the distance a robot must keep is made: "path", from its stopping
            figures and from where it may go while it stops; "speed", from its figures
            and its speed; "fixed", the number `buffer`.
        period: Time from one cycle to the next [s].
        late: How much later than that a cycle may come [s].
        buffer: Distance every pair must keep beyond the modelled surfaces, in "path"
            and "speed" beside the need by the figures [m]. By default 5 mm for robots
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
        >>> item = scene.add(
        ...     Box(size=(1.2, 2.0, 0.05)), "table", pose=Pose(xyz=(0.5, 0, -0.03))
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
        super().__init__(mode, buffer, margin)
        self.period = check_amount("period", period, "s")
        if period == 0.0:
            raise SceneError("period is 0 s; it must be > 0")
        self.late = check_amount("late", late, "s")
        for what, value in (("period", self.period), ("late", self.late)):
            if value >= LEAST_UNLIKELY:
                log.warning(
                    "%s is %g s, and no control loop is so slow; if these are "
                    "milliseconds, give seconds: %g",
                    *(what, value, value * 1e-3),
                )
        self.index = IndexSettings() if index is None else index
        self.notes: list[str] = []

    def __repr__(self) -> str:
        """Names of robots and objects, and the period."""
        robots, objects = ", ".join(self.robots), ", ".join(islice(self.objects, 8))
        more = len(self.objects) - 8
        objects += f" and {more} more" if more > 0 else ""
        return (
            f"<Scene period {self.period * 1e3:g} ms; robots: {robots or 'none'}; "
            f"objects: {objects or 'none'}>"
        )

    def _repr_html_(self) -> str:
        """Robots and objects as tables, for notebooks."""
        robots = [
            (name, robot.model.name, len(robot.model.q_names), robot.mode, robot.base)
            for name, robot in self.robots.items()
        ]
        objects = [
            (name, shapes_in_words(item), item.attached_to or "world", item.pose)
            for name, item in self.objects.items()
        ]
        return html_table(
            f"Scene, period {self.period * 1e3:g} ms",
            ("robot", "model", "joints", "mode", "base"),
            robots,
        ) + html_table("", ("object", "shapes", "frame", "pose"), objects)

    def add_robot(
        self,
        urdf: str | Path | RobotModel,
        name: str,
        *,
        base: Pose | None = None,
        srdf: str | Path | None = None,
        packages: Mapping[str, Path] | None = None,
        stopping: StoppingFigures | Mapping[str, Any] | None = None,
        home: Mapping[str, float] | None = None,
        progress: Progress | None = None,
        **settings: Unpack[RobotKeys],
    ) -> SceneRobot:
        """Add a robot.

        Args:
            urdf: A URDF, xacro or MJCF file, a model, or the name of a robot such as
                "panda", which brings its SRDF and its stopping figures.
            name: Its name in the scene.
            base: Its root frame in the world.
            srdf: Its SRDF file.
            packages: Folders of `package://` names.
            stopping: How it stops: `StoppingFigures`, or figures by the keys of a
                scene file, such as `{"deceleration": 5.0, "delays": {"command":
                0.008}}`. Figures of a robot by name that are not given are its own.
            home: Home positions by joint name; see `home_configuration` for the rest.
            progress: Called with the step, its number and their count, while links
                are fitted.
            settings: How it is guarded, see `RobotSettings`. `response` may be one
                word, its kind, or a mapping as in a scene file.

        Raises:
            SceneError: The name is taken or no name, or a setting cannot be true.
            ModelError: The robot cannot be guarded as it is written.
            FiguresError: A figure cannot be true.
        """
        self._check_name(name)
        owner, given = f"robot '{name}'", dict[str, Any](settings)
        if given.get("mode") is None:
            given["mode"] = self.mode
        if "response" in given:
            given["response"] = response_settings(owner, given["response"])
        robot = scene_robot(
            name,
            load_robot(urdf, srdf, packages),
            checked(owner, RobotSettings(**given)),
            base=base,
            stopping=stopping,
            home=home,
        )
        robot = self._fitted(robot, progress)
        self._robots[name] = robot
        self.notes += [
            f"{owner}: {note}" for note in (*robot.model.notes, *fast_joints(robot))
        ]
        return robot

    def _fitted(self, robot: SceneRobot, progress: Progress | None) -> SceneRobot:
        return fitted(robot, progress)

    def add(
        self,
        shapes: Part | Sequence[Part],
        name: str,
        *,
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
        kept = PLAIN
        if settings:
            given = ObjectSettings(**dict[str, Any](settings))
            kept = checked(f"object '{name}'", given)
        if kept.attached_to is not None:
            self._check_body(kept.attached_to, link=True)
        parts = shapes if isinstance(shapes, Sequence) else (shapes,)
        item = self._objects[name] = scene_object(name, parts, pose, kept)
        if lengths := strange_lengths(item):
            self.strange_count += 1
            if self.strange_count <= NAMED_STRANGE:
                for what, length in lengths.items():
                    warn_of_length(what, length)
        return item

    def add_mesh(
        self,
        mesh: MeshInput,
        name: str,
        *,
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
            progress: Called with the step, its number and their count, if it
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
            >>> ramp = Scene().add_mesh((vertices, faces), "ramp")
            >>> len(ramp.surfaces[0])
            2
        """
        self._check_name(name)
        link = settings.get("attached_to")
        if link is not None and form == "triangles":
            raise SceneError(f"object '{name}' {riding_surface(link)}")
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

    def set_response(
        self,
        response: ResponseName | ResponseSettings | Mapping[str, Any],
        robot: str | None = None,
    ) -> None:
        """Change the responses of robots to near bodies.

        Args:
            response: The response, or its settings.
            robot: The robot it is for; all if None.

        Raises:
            SceneError: A setting is out of range.
            UnknownNameError: There is no such robot.
        """
        for name in self._named(robot):
            self._change(name, response=response_settings(f"robot '{name}'", response))

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
                self._change(name, stopping=replace(robot.stopping, stale=stale))

    def set_stopping(self, name: str, figures: StoppingFigures) -> None:
        """Change the stopping figures of a robot.

        Args:
            name: Name of the robot.
            figures: Its new figures; their vectors are in the order of its `q_names`.

        Raises:
            UnknownNameError: There is no such robot.
        """
        (robot,) = self._named(name)
        self._change(robot, stopping=figures)

    def set_fit(
        self,
        name: str,
        *,
        progress: Progress | None = None,
        **settings: Unpack[FitKeys],
    ) -> None:
        """Fit a robot's links with other settings.

        Args:
            name: Name of the robot.
            progress: See `load_scene`.
            **settings: `fit_target` and `max_primitives`, see `RobotSettings`.

        Raises:
            UnknownNameError: There is no such robot.
            SceneError: A setting cannot be true.
            ModelError: A link cannot be fitted.
        """
        (robot,) = self._named(name)
        checked(f"robot '{robot}'", RobotSettings(**settings))
        changed = replace(self._robots[robot], **settings)
        self._robots[robot] = self._fitted(changed, progress)

    def set_home(self, name: str, home: Mapping[str, float]) -> None:
        """Give a robot another home configuration.

        Args:
            name: The robot.
            home: Positions by joint name; see `home_configuration` for the rest.

        Raises:
            ModelError: A joint does not exist, or is outside its limits.
        """
        model = self._robots[name].model
        self._change(name, home=home_configuration(model, home))

    def validate(self) -> None:
        """Check rules that need the whole scene.

        Raises:
            SceneError: There is no robot, a robot has no stopping figures, an arm
                reaches out of the sensed region, or a buffer exceeds the margin.
            UnknownNameError: What an object may rest on does not exist.
        """
        if not self._robots:
            raise SceneError("the scene has no robot; add one with `add_robot`")
        if not self.q_names:
            raise SceneError("no robot of the scene has a joint that moves")
        check_figures(self._robots.values())
        if self.sensing is not None:
            check_region(self.sensing, self._robots.values())
            check_modes(self._robots.values())
        for item in self._objects.values():
            for support in item.rests_on or ():
                self._check_body(support)
        if self.largest_buffer > self.margin:
            raise SceneError(
                f"a buffer of {self.largest_buffer * 1e3:.1f} mm is larger than the "
                f"margin of {self.margin * 1e3:.1f} mm, so a pair would stop the arm "
                "before it is reported; raise `margin` or leave it out"
            )
