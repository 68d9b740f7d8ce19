"""A scene file with the pose and the delay of a sensor changed, and no other letter."""

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode

from armguard.errors import SceneError
from armguard.geometry.pose import Pose
from armguard.scene.file_edit import flow, item, place_of, values_of, with_value


def with_sensor(text: str, entry: str, pose: Pose, delay: float | None) -> str:
    """The text of a scene file with another pose of a sensor.

    Args:
        text: The text.
        entry: Name of the sensor or of the ring.
        pose: Its pose, written to tenths of millimetres and of milliradians.
        delay: Its delay, written to tenths of milliseconds; None for no change [s].

    Raises:
        SceneError: The file has no such sensor, or is written in a way that cannot be
            edited so.
    """
    before = values_of(text)
    changes: dict[str, object] = {"at": place_of(pose)}
    if delay is not None:
        changes["delay"] = round(delay, 4)
    for key, value in changes.items():
        found = item(YAML(typ="safe", pure=True).compose(text), "sensors")
        own = item(found[1], entry) if found is not None else None
        if own is None or not isinstance(own[1], MappingNode):
            raise SceneError(f"the scene file has no sensor '{entry}' to edit")
        text = with_value(text, own[1], key, flow(value))
    after = values_of(text)
    wanted = {**before["sensors"], entry: {**before["sensors"][entry], **changes}}
    if after != {**before, "sensors": wanted}:
        raise SceneError(
            f"the entry of '{entry}' is written in a way that cannot be edited from "
            "here; edit the file by hand"
        )
    return text
