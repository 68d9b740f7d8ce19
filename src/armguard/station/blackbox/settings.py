"""Settings of a recorded scene, changed by name, as in `guard.mode=speed`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from armguard.errors import ArmguardError, did_you_mean
from armguard.scene.scene import Scene, SceneRobot, check_mode, response_settings
from armguard.scene.settings import CHOICES, MODES, ResponseSettings
from armguard.station.errors import SettingError

# Numbers of a scene.
OF_SCENE = ("buffer", "margin", "late")

# Figures of a robot's stop that may be changed; a vector gets the same for all joints.
OF_STOPPING = (
    "acceleration",
    "deceleration",
    "ramp",
    "settle",
    "settle_time",
    "brake_delay",
    "brake_deceleration",
    "position_error",
    "velocity_error",
    "tracking_error",
    "sensing",
    "model_error",
    "base_error",
    "base_turn",
)


@dataclass(slots=True)
class Changed:
    """A scene with other settings.

    Attributes:
        scene: The scene; what it was made of is not touched.
        budget: Spans a cycle may test.
    """

    scene: Scene
    budget: int


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

    def set_scene(name: str, value: str) -> None:
        if name == "margin":
            scene.set_margin(number(value))
        else:
            setattr(scene, name, not_negative(value))

    def set_budget(value: str) -> None:
        changed.budget = int(value)
        if changed.budget < 1:
            raise SettingError("it must be >= 1")

    found: dict[str, Callable[[str], None]] = {
        "guard.mode": lambda value: scene.set_mode(mode(value)),
        "scene.mode": lambda value: scene.set_mode(mode(value)),
        "guard.budget": set_budget,
    }
    for name in OF_SCENE:
        found[f"scene.{name}"] = lambda value, name=name: set_scene(name, value)  # type: ignore[misc]
    for ending, act in of_robot().items():

        def of_all(value: str, act: Any = act) -> None:
            for name in scene.robots:
                put(scene, act(scene.robots[name], value))

        if ending.startswith(("response", "stopping")):
            found[ending] = of_all
        for robot in scene.robots:

            def of_one(value: str, robot: str = robot, act: Any = act) -> None:
                put(scene, act(scene.robots[robot], value))

            found[f"robots.{robot}.{ending}"] = of_one
    for name in scene.objects:

        def set_object(value: str, name: str = name) -> None:
            scene._objects[name] = replace(
                scene.objects[name], buffer=not_negative(value)
            )

        found[f"objects.{name}.buffer"] = set_object
    return found


def put(scene: Scene, robot: SceneRobot) -> None:
    """Put a robot in the place of the one of its name."""
    scene._robots[robot.name] = robot


def of_robot() -> dict[str, Callable[[SceneRobot, str], SceneRobot]]:
    """What changes each setting of a robot."""

    def response(robot: SceneRobot, key: str, value: Any) -> SceneRobot:
        own = replace(robot.response, **{key: value})
        who = f"robot '{robot.name}'"
        return replace(robot, response=response_settings(who, own))

    def stopping(robot: SceneRobot, key: str, value: str) -> SceneRobot:
        if robot.stopping is None:
            raise SettingError(f"nobody said how robot '{robot.name}' stops")
        was = getattr(robot.stopping, key)
        now: Any = not_negative(value)
        if isinstance(was, np.ndarray):
            now = np.full_like(was, now)
        figures = replace(robot.stopping, **{key: now})
        return replace(robot, stopping=figures)

    found: dict[str, Callable[[SceneRobot, str], SceneRobot]] = {
        "mode": lambda robot, value: replace(robot, mode=mode(value)),
        "buffer": lambda robot, value: replace(robot, buffer=not_negative(value)),
        "response": lambda robot, value: response(
            robot, "kind", choice(value, CHOICES["kind"])
        ),
    }
    for field in fields(ResponseSettings):
        key, default = field.name, field.default
        read = reader(key, default)
        found[f"response.{key}"] = (
            lambda robot, value, key=key, read=read: response(robot, key, read(value))  # type: ignore[misc]
        )
    for key in OF_STOPPING:
        found[f"stopping.{key}"] = (
            lambda robot, value, key=key: stopping(robot, key, value)  # type: ignore[misc]
        )
    return found


def reader(key: str, default: object) -> Callable[[str], Any]:
    """What reads a setting of a response."""
    if key in CHOICES:
        return lambda value: choice(value, CHOICES[key])
    return truth if isinstance(default, bool) else number


def mode(value: str) -> Any:
    """A mode."""
    return check_mode("the mode", choice(value, MODES))


def choice(value: str, known: tuple[str, ...]) -> Any:
    """One of several words.

    Raises:
        SettingError: It is none of them.
    """
    if value not in known:
        raise SettingError(f"'{value}' is none of them; {did_you_mean(value, known)}")
    return value


def number(value: str) -> float:
    """A number.

    Raises:
        SettingError: It is none.
    """
    try:
        return float(value)
    except ValueError:
        raise SettingError(f"'{value}' is no number") from None


def not_negative(value: str) -> float:
    """A finite number that is not negative.

    Raises:
        SettingError: It is something else.
    """
    found = number(value)
    if not 0.0 <= found < np.inf:
        raise SettingError(f"it is {value}; it must be finite and >= 0")
    return found


def truth(value: str) -> bool:
    """True or false.

    Raises:
        SettingError: It is neither.
    """
    if value not in ("true", "false"):
        raise SettingError(f"it is '{value}'; it must be true or false")
    return value == "true"
