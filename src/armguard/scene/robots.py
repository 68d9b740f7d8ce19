"""Robots of a scene: a model with its fits, its place and its settings."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from armguard.errors import SceneError
from armguard.geometry.pose import Pose
from armguard.robot.fitting import fit_robot
from armguard.robot.known_arms import known_home
from armguard.robot.limits import home_configuration
from armguard.robot.model import FittedLink, RobotModel
from armguard.robot.named import find_named_robot
from armguard.robot.stopping import (
    StoppingFigures,
    declared_figures,
    known_figures,
    named_figures,
)
from armguard.robot.urdf import load_urdf
from armguard.scene.gripping import check_links
from armguard.scene.meshes import Progress
from armguard.scene.schema import checked, part_of
from armguard.scene.settings import (
    MODES,
    Mode,
    ResponseName,
    ResponseSettings,
    RobotSettings,
)


@dataclass(frozen=True, kw_only=True, repr=False)
class SceneRobot(RobotSettings):
    """A robot in a scene.

    Attributes:
        name: Its name in the scene.
        model: Its files.
        fits: Primitives of each link that has collision geometry.
        base: Its root frame in the world.
        home: Home position of each joint [rad or m].
        mode: How the distance it must keep is made.
        stopping: How it stops; None if not declared, which only mode "fixed" allows.
    """

    name: str
    model: RobotModel
    fits: Mapping[str, FittedLink]
    base: Pose
    home: Mapping[str, float]
    mode: Mode
    stopping: StoppingFigures | None

    def __repr__(self) -> str:
        """Name, model, mode and base."""
        joints = len(self.model.q_names)
        return (
            f"<SceneRobot {self.name}: {self.model.name}, {joints} joints, mode "
            f"{self.mode}, base {self.base}>"
        )


def load_robot(
    urdf: str | Path | RobotModel,
    srdf: str | Path | None,
    packages: Mapping[str, Path] | None,
) -> tuple[RobotModel, Mapping[str, float], StoppingFigures | None]:
    """A robot by its file, by its name, or by its model; see `Scene.add_robot`.

    Returns:
        The model; home positions by joint name [rad or m] and stopping figures, as far
        as a robot by name, or a recognised arm, has some.
    """
    if isinstance(urdf, RobotModel):
        return urdf, {}, None
    path = Path(urdf)
    if path.exists() or path.suffix or len(path.parts) > 1:
        model = load_urdf(path, srdf=srdf, packages=packages)
        return model, known_home(model), known_figures(model)
    named = find_named_robot(str(urdf))
    srdf = named.srdf if srdf is None else srdf
    model = load_urdf(named.urdf, srdf=srdf, packages=packages)
    return model, named.home, named_figures(str(urdf), model)


def scene_robot(
    name: str,
    loaded: tuple[RobotModel, Mapping[str, float], StoppingFigures | None],
    settings: RobotSettings,
    *,
    base: Pose | None,
    stopping: StoppingFigures | Mapping[str, Any] | None,
    home: Mapping[str, float] | None,
    progress: Progress | None,
) -> SceneRobot:
    """A robot as `load_robot` has it, fitted; see `Scene.add_robot`.

    Raises:
        SceneError: Its gripper is none.
        ModelError: A link cannot be fitted, or it cannot be at home there.
        FiguresError: A figure cannot be true.
    """
    model, own_home, own = loaded
    if stopping is None:
        stopping = own
    elif not isinstance(stopping, StoppingFigures):
        stopping = declared_figures(model, stopping, own)
    at_home = home_configuration(model, {**own_home, **(home or {})})
    fits = fit_robot(
        model,
        target=settings.fit_target,
        max_primitives=settings.max_primitives,
        progress=progress and fitting(progress),
    )
    if settings.gripper is not None:
        check_links(name, model, fits, settings.gripper)
    return SceneRobot(
        name=name,
        model=model,
        fits=fits,
        base=Pose() if base is None else base,
        home=at_home,
        stopping=stopping,
        **part_of(settings, RobotSettings),
    )


def fitting(progress: Progress) -> Progress:
    """A progress of links that says what is done with them."""
    return lambda link, number, count: progress(f"fitting {link}", number, count)


def check_figures(robot: SceneRobot) -> None:
    """A robot has the figures its mode needs.

    Raises:
        SceneError: It does not.
    """
    if robot.mode != "fixed" and robot.stopping is None:
        raise SceneError(
            f"robot '{robot.name}' is in mode '{robot.mode}' and has no stopping "
            "figures; give it `stopping: {deceleration: ...}` (least deceleration of a "
            "controlled stop [rad/s² or m/s²], see docs/stopping.md), or set "
            "`mode: fixed`"
        )


def response_settings(
    who: str, response: ResponseName | ResponseSettings | Mapping[str, Any]
) -> ResponseSettings:
    """The settings, also from a name, or from a mapping as in a scene file.

    Raises:
        SceneError: It is none, or a setting cannot be true.
    """
    if isinstance(response, str):
        response = ResponseSettings(kind=response)
    return checked(who, response, "response", ResponseSettings)


def check_mode(what: str, mode: Mode) -> Mode:
    """Return a mode that exists.

    Raises:
        SceneError: It does not.
    """
    if mode not in MODES:
        raise SceneError(f"{what} is {mode!r}; it must be one of {', '.join(MODES)}")
    return mode
