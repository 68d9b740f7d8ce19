"""Robots of a scene: a model with its fits, its place and its settings."""

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import radians
from pathlib import Path
from typing import Any

from armguard.errors import SceneError
from armguard.geometry.pose import LOOKS_LIKE_DEGREES, Pose
from armguard.robot.fitting import fit_robot
from armguard.robot.known_arms import known_home
from armguard.robot.limits import home_configuration
from armguard.robot.model import FittedLink, JointKind, RobotModel
from armguard.robot.named import find_named_robot
from armguard.robot.stopping import (
    StoppingFigures,
    declared_figures,
    known_figures,
    named_figures,
)
from armguard.robot.stopping.declared import DEFAULTS
from armguard.robot.stopping.figures import FIGURES
from armguard.robot.urdf import load_urdf
from armguard.scene.gripping import check_links
from armguard.scene.meshes import Progress
from armguard.scene.objects import checked_pose, farthest_point, warn_of_length
from armguard.scene.schema import BRIEF, checked, part_of
from armguard.scene.settings import (
    MODES,
    Mode,
    ResponseName,
    ResponseSettings,
    RobotSettings,
)

# Largest deceleration that is proposed unmeasured [rad/s² or m/s²].
MOST_GUESSED = 5.0

log = logging.getLogger("armguard")

# Few arms brake a joint harder in every stop [rad/s²].
MOST_DECELERATION = 40.0

# Limits beyond this, such as 1e16, say that a joint has none [rad].
MOST_DEGREES = 720.0


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
        return urdf, known_home(urdf), known_figures(urdf)
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
) -> SceneRobot:
    """A robot as `load_robot` has it, not fitted yet; see `Scene.add_robot`.

    Raises:
        SceneError: Its gripper is none.
        ModelError: It cannot be at home there.
        FiguresError: A figure cannot be true.
    """
    model, own_home, own = loaded
    warn_of_limits(f"robot '{name}'", model)
    owner, joint = f"robot '{name}'", model.q_names[0] if model.q_names else "joint"
    base = checked_pose(f"{owner}: base", base)
    warn_of_length(f"{owner}: base", max(map(abs, base.xyz)))
    check_mapping(f"{owner}: home", home, f"{{'{joint}': 0.1}}")
    if stopping is None:
        stopping = own
    elif not isinstance(stopping, StoppingFigures):
        check_mapping(f"{owner}: stopping", stopping, "{'deceleration': 5.0}")
        stopping = declared_figures(model, stopping, own)
        warn_of_deceleration(owner, model, stopping)
    if settings.gripper is not None:
        check_links(name, model, settings.gripper)
    return SceneRobot(
        name=name,
        model=model,
        fits={},
        base=base,
        home=home_configuration(model, {**own_home, **(home or {})}),
        stopping=stopping,
        **part_of(settings, RobotSettings),
    )


def warn_of_limits(owner: str, model: RobotModel) -> None:
    """Write to the log that joint limits look like degrees, if they do."""
    for joint in model.joints.values():
        most = max(abs(joint.lower), abs(joint.upper))
        turns = joint.kind is JointKind.REVOLUTE
        if turns and LOOKS_LIKE_DEGREES < most <= MOST_DEGREES:
            log.warning(
                "%s: the limits of joint '%s' in line %d are [%g, %g] rad, more than "
                "two turns; if these are degrees, give radians: [%.4g, %.4g]",
                *(owner, joint.name, joint.line, joint.lower, joint.upper),
                *(radians(joint.lower), radians(joint.upper)),
            )
            return


def warn_of_deceleration(
    owner: str, model: RobotModel, figures: StoppingFigures
) -> None:
    """Write to the log that a deceleration looks like degrees, if it does."""
    for name, figure in zip(figures.joints, figures.deceleration, strict=True):
        turns = model.joints[name].kind is JointKind.REVOLUTE
        if turns and figure > MOST_DECELERATION:
            log.warning(
                "%s: deceleration of joint '%s' is %g rad/s², and few arms brake so "
                "hard; if these are degrees, give radians: %.3g",
                *(owner, name, figure, radians(figure)),
            )
            return


def check_mapping(what: str, value: object, example: str) -> None:
    """Refuse values that are not given by name.

    Args:
        what: What they are.
        value: A mapping, or None.
        example: Values as they must be given.

    Raises:
        SceneError: They are not.
    """
    if value is not None and not isinstance(value, Mapping):
        raise SceneError(
            f"{what} is {BRIEF.repr(value)}; give a mapping by name, such as {example}"
        )


def fitted(robot: SceneRobot, progress: Progress | None) -> SceneRobot:
    """The robot with primitives around its links.

    Raises:
        ModelError: A link cannot be fitted.
    """
    fits = fit_robot(
        robot.model,
        target=robot.fit_target,
        max_primitives=robot.max_primitives,
        progress=progress and fitting(progress),
    )
    for link, fit in fits.items():
        far = max((farthest_point(placed) for placed in fit.shapes), default=0.0)
        if warn_of_length(f"robot '{robot.name}': link '{link}'", far):
            break
    return replace(robot, fits=fits)


def fitting(progress: Progress) -> Progress:
    """A progress of links that says what is done with them."""
    return lambda link, number, count: progress(f"fitting {link}", number, count)


def check_figures(robots: Iterable[SceneRobot]) -> None:
    """Robots have the figures their modes need.

    Raises:
        SceneError: Some do not; robots of one file share one sentence.
    """
    if lacking := lacking_figures(robots):
        raise SceneError("\n".join(map(without_figures, lacking)))


def lacking_figures(robots: Iterable[SceneRobot]) -> list[list[SceneRobot]]:
    """Robots without the stopping figures that their modes need, by file and mode."""
    lacking: dict[object, list[SceneRobot]] = {}
    for robot in robots:
        if robot.mode != "fixed" and robot.stopping is None:
            key = robot.model.path, robot.model.expanded, robot.mode
            lacking.setdefault(key, []).append(robot)
    return list(lacking.values())


def without_figures(robots: Sequence[SceneRobot]) -> str:
    """That robots of one file have no stopping figures, and the line to paste."""
    first, names = robots[0], ", ".join(f"'{robot.name}'" for robot in robots)
    one = len(robots) == 1
    return (
        f"robot{'' if one else 's'} {names} {'is' if one else 'are'} in mode "
        f"'{first.mode}' and {'has' if one else 'have'} no stopping figures; give "
        f"{'it' if one else 'each'} the least deceleration of a controlled stop "
        "[rad/s² or m/s²], see docs/stopping.md, or set `mode: fixed`:\n"
        f"  {stopping_line(first.model)}  # assumed: measure it"
    )


def stopping_line(model: RobotModel) -> str:
    """The line of a scene file that declares how a robot stops, with a first guess."""
    return f"stopping: {{deceleration: {first_guess(model):g}}}"


def first_guess(model: RobotModel) -> float:
    """A deceleration to begin with: top speed is stopped in a second, 5 at most.

    Returns:
        The deceleration, a number for all joints [rad/s² or m/s²].
    """
    joints = [model.joints[name] for name in model.q_names]
    turning = [joint for joint in joints if joint.kind is not JointKind.PRISMATIC]
    known = [joint.velocity for joint in turning or joints if joint.velocity]
    return float(f"{min([*known, MOST_GUESSED]):.2g}")


def fast_joints(robot: SceneRobot) -> list[str]:
    """A note about top speeds of the URDF that no arm has; empty if there are none."""
    model, figures = robot.model, robot.stopping
    if figures is None or figures.sources.get("velocity") != DEFAULTS["velocity"]:
        return []
    ceiling = FIGURES["velocity"].ceiling
    fast = [model.joints[n] for n in model.q_names]
    fast = [joint for joint in fast if (joint.velocity or 0.0) > ceiling]
    if not fast or model.path is None:
        return []
    first, more = fast[0], f" and {len(fast) - 1} more" if len(fast) > 1 else ""
    return [
        f"'{model.file}' line {first.line}: joint '{first.name}'{more} has the "
        f"speed limit {first.velocity:g}, more than arms reach; if the drives are "
        "slower, set `stopping: {velocity: 5}` [rad/s or m/s]"
    ]


def response_settings(
    owner: str, response: ResponseName | ResponseSettings | Mapping[str, Any]
) -> ResponseSettings:
    """The settings, also from a name, or from a mapping as in a scene file.

    Raises:
        SceneError: It is none, or a setting cannot be true.
    """
    if isinstance(response, str):
        response = ResponseSettings(kind=response)
    return checked(owner, response, "response", ResponseSettings)


def check_mode(what: str, mode: Mode) -> Mode:
    """Return a mode that exists.

    Raises:
        SceneError: It does not.
    """
    if mode not in MODES:
        raise SceneError(f"{what} is {mode!r}; it must be one of {', '.join(MODES)}")
    return mode
