"""Settings of a recorded scene, changed by name, as in `guard.mode=speed`."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np

from armguard.errors import ArmguardError, SettingError, did_you_mean
from armguard.scene.scene import Scene, SceneRobot, response_settings
from armguard.scene.settings import CHOICES, MODES, ResponseSettings

# Figures of a robot's stop that may be changed; a vector gets the same for all joints.
OF_STOPPING = (
    *("acceleration", "deceleration", "ramp", "settle", "settle_time"),
    *("brake_delay", "brake_deceleration", "position_error", "velocity_error"),
    *("tracking_error", "sensing", "model_error", "base_error", "base_turn"),
)

# A robot with one setting changed, from its value as text.
RobotChange = Callable[[SceneRobot, str], SceneRobot]


@dataclass(slots=True)
class Changed:
    """A scene with other settings."""

    scene: Scene  # its file is not touched
    budget: int  # spans a cycle may test


def change(scene: Scene, budget: int, settings: Mapping[str, str]) -> Changed:
    """Change settings by name.

    Args:
        scene: The scene; it is written.
        budget: Spans a cycle may test.
        settings: Values by name, both as text.

    Raises:
        SettingError: There is no such setting, or it cannot have that value.
    """
    changed = Changed(scene, budget)
    for name, value in settings.items():
        known = changes(changed)
        if name not in known:
            raise SettingError(
                f"there is no setting '{name}'; {did_you_mean(name, known)}"
            )
        try:
            known[name](value)
        except (ArmguardError, ValueError) as error:
            raise SettingError(f"{name}={value}: {error}") from error
    try:
        scene.validate()
    except ArmguardError as error:
        raise SettingError(f"with these settings: {error}") from error
    return changed


def changes(changed: Changed) -> dict[str, Callable[[str], None]]:
    """What changes each setting there is, by name."""
    scene = changed.scene
    found: dict[str, Callable[[str], None]] = {
        **dict.fromkeys(
            ("guard.mode", "scene.mode"), lambda v: scene.set_mode(choice(v, MODES))
        ),
        "guard.budget": lambda v: setattr(changed, "budget", at_least_one(v)),
        "scene.buffer": lambda v: setattr(scene, "buffer", not_negative(v)),
        "scene.margin": lambda v: scene.set_margin(number(v)),
        "scene.late": lambda v: setattr(scene, "late", not_negative(v)),
    }
    for ending, act in of_robot().items():
        if ending.startswith(("response", "stopping")):
            found[ending] = partial(set_robots, scene, tuple(scene.robots), act)
        for robot in scene.robots:
            name = f"robots.{robot}.{ending}"
            found[name] = partial(set_robots, scene, (robot,), act)
    for name in scene.objects:
        found[f"objects.{name}.buffer"] = partial(set_object, scene, name)
    return found


def of_robot() -> dict[str, RobotChange]:
    """What changes each setting of a robot."""
    found: dict[str, RobotChange] = {
        "mode": lambda robot, value: replace(robot, mode=choice(value, MODES)),
        "buffer": lambda robot, value: replace(robot, buffer=not_negative(value)),
        "response": partial(with_response, "kind"),
    }
    for field in fields(ResponseSettings):
        found[f"response.{field.name}"] = partial(with_response, field.name)
    for key in OF_STOPPING:
        found[f"stopping.{key}"] = partial(with_stopping, key)
    return found


def set_object(scene: Scene, name: str, value: str) -> None:
    """Set the buffer of an object."""
    own = replace(scene.objects[name], buffer=not_negative(value))
    scene._objects[name] = own


def set_robots(
    scene: Scene, names: Iterable[str], act: RobotChange, value: str
) -> None:
    """Change a setting of robots."""
    for name in names:
        scene._robots[name] = act(scene.robots[name], value)


def with_response(key: str, robot: SceneRobot, value: str) -> SceneRobot:
    """A robot with another setting of its response."""
    read: Callable[[str], Any] = number
    if key in CHOICES:
        read = partial(choice, known=CHOICES[key])
    elif isinstance(getattr(robot.response, key), bool):
        read = truth
    own = replace(robot.response, **{key: read(value)})
    return replace(robot, response=response_settings(f"robot '{robot.name}'", own))


def with_stopping(key: str, robot: SceneRobot, value: str) -> SceneRobot:
    """A robot with another figure of its stop."""
    if robot.stopping is None:
        raise SettingError(f"robot '{robot.name}' has no stopping figures")
    was, now = getattr(robot.stopping, key), not_negative(value)
    figure: Any = np.full_like(was, now) if isinstance(was, np.ndarray) else now
    return replace(robot, stopping=replace(robot.stopping, **{key: figure}))


# Each of these raises `SettingError` for what it cannot read.


def choice(value: str, known: tuple[str, ...]) -> Any:
    """One of several words."""
    if value not in known:
        raise SettingError(f"'{value}' is none of them; {did_you_mean(value, known)}")
    return value


def number(value: str) -> float:
    """A number."""
    try:
        return float(value)
    except ValueError:
        raise SettingError(f"'{value}' is no number") from None


def at_least_one(value: str) -> int:
    """A count."""
    if (found := int(value)) < 1:
        raise SettingError("it must be >= 1")
    return found


def not_negative(value: str) -> float:
    """A finite number that is not negative."""
    found = number(value)
    if not 0.0 <= found < np.inf:
        raise SettingError(f"it is {value}; it must be finite and >= 0")
    return found


def truth(value: str) -> bool:
    """True or false."""
    if value not in ("true", "false"):
        raise SettingError(f"it is '{value}'; it must be true or false")
    return value == "true"
