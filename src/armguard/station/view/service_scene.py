"""The very scene a service guards, built again from what it tells about itself."""

from collections.abc import Iterator
from typing import Any

from armguard.scene import Scene, compile_scene
from armguard.scene.bay import bay_path
from armguard.scene.settings import CHOICES
from armguard.scene.two_pandas import two_pandas_path
from armguard.station.client import Welcome
from armguard.station.errors import StationError
from armguard.station.service.scenes import open_scene, scene_hash

# Modes a service may guard by.
MODES = ("path", "speed")


def guarded_scene(welcome: Welcome) -> Scene:
    """The scene of a service; its tables have the service's hash.

    Args:
        welcome: What the service told.

    Raises:
        StationError: The scene that is found is another one, so drawing it would show
            something that was not checked.
        SceneError: There is no such scene.
    """
    bundled = {"": "two-pandas", str(bay_path()): "bay"}
    bundled[str(two_pandas_path())] = "two-pandas"
    name = bundled.get(welcome.scene_file, welcome.scene_file)
    scene, _ = open_scene(
        name,
        period=welcome.period,
        late=float(welcome.text["late"]),
        stale=welcome.text["stale"],
    )
    for modes, responses in settings_of(scene):
        for robot in scene.robots:
            scene.set_mode(modes[robot], robot)
            scene.set_response(responses[robot], robot)
        if scene_hash(compile_scene(scene)) == welcome.scene_hash:
            return scene
    raise StationError(
        f"the service guards another scene than the one in '{name}'; was the file "
        "changed since it started? start it again"
    )


def settings_of(scene: Scene) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Modes and responses that a service may have been told, by robot.

    As `serve` and `configure` set them: those of the scene, or one for all.
    """
    own = {name: robot.response for name, robot in scene.robots.items()}
    modes = {name: robot.mode for name, robot in scene.robots.items()}
    for mode in (None, *MODES):
        now = modes if mode is None else dict.fromkeys(modes, mode)
        yield now, own
        for kind in CHOICES["kind"]:
            yield now, dict.fromkeys(own, kind)
