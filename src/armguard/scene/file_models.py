"""The scene file's grammar: what keys there are, and what they hold."""

from dataclasses import dataclass, field
from math import inf
from typing import Annotated, Any, Self

from pydantic import Field, model_validator
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue

from armguard.geometry.pose import Pose
from armguard.geometry.shapes import PlacedShape
from armguard.scene.contents import Allowance
from armguard.scene.file_shapes import (
    ORIGIN,
    Place,
    PoseModel,
    ShapeKeys,
    ShapeModel,
)
from armguard.scene.file_stopping import StoppingModel
from armguard.scene.meshes import Progress, Surface
from armguard.scene.schema import CLOSED, NotNegative, Number, Strict, meanings
from armguard.scene.settings import (
    DEFAULT_MODE,
    CycleSettings,
    IndexSettings,
    Mode,
    ObjectSettings,
    RobotSettings,
)

# Most robots and objects of a scene file.
MOST_ROBOTS = 64
MOST_OBJECTS = 5_000


@dataclass(frozen=True, kw_only=True)
class ObjectEntry(ObjectSettings, ShapeKeys):
    """An object of the scene: exactly one shape, or a union of several.

    Attributes:
        union: Shapes, each with a pose of its own.
        at: A pose, in the world or in the link it is attached to.
    """

    __pydantic_config__ = CLOSED

    union: Annotated[list[ShapeModel], Field(min_length=1)] | None = None
    at: PoseModel = ORIGIN

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        self.check_one("union")
        return self

    def parts_of_all(
        self, place: Place, progress: Progress | None
    ) -> list[Surface | PlacedShape]:
        """Parts of the object, in its own frame; see `ShapeKeys.parts`."""
        if self.union is None:
            return self.parts(Pose(), place, progress)
        return [
            part
            for entry in self.union
            for part in entry.parts(entry.at.pose(), place, progress)
        ]


@dataclass(frozen=True, kw_only=True)
class RobotEntry(RobotSettings):
    """A robot of the scene.

    Attributes:
        urdf: A URDF file, or a robot's name.
        srdf: Its SRDF file.
        base: A pose.
        stopping: Its stopping figures, see docs/stopping.md.
        home: Positions by joint [rad or m].
        packages: Folders of `package://` names, for this robot alone.
    """

    __pydantic_config__ = CLOSED

    urdf: str
    srdf: str | None = None
    base: PoseModel = ORIGIN
    stopping: StoppingModel | None = None
    home: dict[str, Number] = field(default_factory=dict)
    packages: dict[str, str] = field(default_factory=dict)
    # The default is that of the settings; a file may ask for less work.
    max_primitives: Annotated[int, Field(ge=1, le=64)]


class BufferEntry(Strict):
    """The distance of a pair [m]."""

    a: str
    b: str
    buffer: NotNegative


class SceneModel(Strict):
    """The whole file.

    Attributes:
        robots: Robots by name.
        objects: Objects by name.
        packages: Folders of `package://` names.
        mode: How the distance that a robot keeps is made.
        cycle: When the guard is called.
        buffer: Distance every pair keeps [m].
        margin: Signed distance up to which pairs are reported [m].
        allow: Pairs that may touch.
        buffers: Distances of pairs; a robot's name is all its links.
        index: How near pairs are found.
    """

    robots: Annotated[
        dict[str, RobotEntry], Field(min_length=1, max_length=MOST_ROBOTS)
    ]
    objects: Annotated[dict[str, ObjectEntry], Field(max_length=MOST_OBJECTS)] = Field(
        default={}
    )
    packages: dict[str, str] = Field(default={})
    mode: Mode = DEFAULT_MODE
    cycle: CycleSettings = CycleSettings()
    buffer: NotNegative | None = None
    margin: NotNegative | None = None
    allow: list[Allowance] = Field(default=[])
    buffers: list[BufferEntry] = Field(default=[])
    index: IndexSettings = IndexSettings()


class WithMeanings(GenerateJsonSchema):
    """A JSON Schema that has what classes' docstrings say of their attributes."""

    def dataclass_schema(self, schema: Any) -> JsonSchemaValue:
        """A mapping of settings."""
        return described(schema["cls"], super().dataclass_schema(schema))

    def model_schema(self, schema: Any) -> JsonSchemaValue:
        """A mapping of the file alone."""
        return described(schema["cls"], super().model_schema(schema))


def described(kind: type, schema: JsonSchemaValue) -> JsonSchemaValue:
    """A class's schema with the meaning of each of its attributes."""
    schema["description"] = schema["description"].partition("\n\nAttributes:")[0]
    means = meanings(kind)
    for name, attribute in schema["properties"].items():
        if name in means:
            attribute["description"] = means[name]
        if attribute.get("default") == inf:
            del attribute["default"]
    return schema


def scene_schema() -> dict[str, Any]:
    """The JSON Schema of a scene file; an infinite default is left out."""
    return SceneModel.model_json_schema(schema_generator=WithMeanings)


def known_keys(keys: tuple[str | int, ...]) -> list[str]:
    """Keys that a mapping of the file may have, by the keys that lead to it."""
    schema = scene_schema()

    def branches(node: Any) -> list[dict[str, Any]]:
        if not isinstance(node, dict):
            return []
        if "$ref" in node:
            return branches(schema["$defs"][node["$ref"].rpartition("/")[2]])
        options = node.get("anyOf") or node.get("oneOf") or ()
        return [node, *(found for option in options for found in branches(option))]

    found = branches(schema)
    for key in keys:
        inner = "items" if isinstance(key, int) else "additionalProperties"
        found = [
            branch
            for node in found
            for branch in branches(node.get("properties", {}).get(key, node.get(inner)))
        ]
    return [key for node in found for key in node.get("properties", ())]
