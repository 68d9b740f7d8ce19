"""The scene file's grammar: what keys there are, and what they hold."""

from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Discriminator, Field, Tag, create_model, model_validator
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue

from armguard.geometry.pose import Pose
from armguard.geometry.shapes import PlacedShape
from armguard.robot.stopping import FiguresError, StoppingFigures, TableFile
from armguard.robot.stopping.figures import FIGURES, Figure
from armguard.scene.contents import Allowance
from armguard.scene.file_shapes import (
    ORIGIN,
    Place,
    PoseModel,
    ShapeKeys,
    ShapeModel,
)
from armguard.scene.meshes import Progress, Surface
from armguard.scene.schema import (
    CLOSED,
    METRES,
    MOST_MARGIN,
    ByJoint,
    Name,
    NotNegative,
    Number,
    Positive,
    Strict,
    Triple,
    at_most,
    meanings,
    part_of,
)
from armguard.scene.sensing import (
    ReflexSettings,
    SceneZone,
    SensingSettings,
    ZoneSettings,
)
from armguard.scene.sensors import SensorSettings
from armguard.scene.settings import (
    DEFAULT_MODE,
    CycleSettings,
    IndexSettings,
    Mode,
    ObjectSettings,
    RobotSettings,
)
from armguard.scene.yaml_source import Keys

# Most robots, sensors and objects of a scene file.
MOST_ROBOTS = 64
MOST_SENSORS = 256
MOST_OBJECTS = 5_000

# Most zones of sensed space; each cell is compared with all of them.
MOST_ZONES = 16


# Infinite is an answer here: how hard a stop can be may be unknown.
Most = Annotated[float, Field(gt=0.0)]


def kind_of_tables(value: Any) -> str:
    """Which branch of `tables` a value is for."""
    if not isinstance(value, dict):
        return "branch-file"
    return "branch-chosen" if "file" in value else "branch-rows"


class TableFileModel(Strict):
    """A file of measured stops, and the conditions that are met here."""

    file: Name
    load: NotNegative | None = None
    extension: NotNegative | None = None


TablesByKind = Annotated[
    Annotated[Name, Tag("branch-file")]
    | Annotated[TableFileModel, Tag("branch-chosen")]
    | Annotated[
        dict[str, Annotated[list[Triple], Field(min_length=1)]],
        Tag("branch-rows"),
    ],
    Discriminator(kind_of_tables),
]


def type_of(figure: Figure) -> Any:
    """What the file may have for a figure."""
    by_joint: Any = ByJoint
    number: Any = Positive if figure.positive else NotNegative
    if not figure.bounded:
        number = Most
    return (by_joint[number] if figure.unit is None else number) | None


def figure_keys() -> type[Strict]:
    """A mapping with a key for each figure, and mappings where keys have dots."""
    groups: dict[str, dict[str, Any]] = {}
    means = meanings(StoppingFigures)
    for name, figure in FIGURES.items():
        group, _, key = figure.key.rpartition(".")
        given = Field(default=None, description=means.get(name))
        groups.setdefault(group, {})[key] = (type_of(figure), given)
    plain = groups.pop("")
    for group, keys in groups.items():
        name, doc = f"{group.title()}Model", f"Figures under `{group}`."
        model = create_model(name, __base__=Strict, __doc__=doc, **keys)
        plain[group] = (model, model())
    return create_model("FigureKeys", __base__=Strict, **plain)


class StoppingModel(figure_keys()):  # type: ignore[misc]
    """How a robot stops, and how well it is known where it is."""

    tables: TablesByKind | None = None
    sources: dict[str, str] | None = None


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
        urdf: A URDF, xacro or MJCF file, or a robot's name.
        srdf: Its SRDF file.
        base: A pose.
        stopping: Its stopping figures, see docs/stopping.md.
        home: Positions by joint [rad or m].
        packages: Folders of `package://` names, for this robot alone.
        xacro_args: Values of the arguments of a xacro file, by name.
    """

    __pydantic_config__ = CLOSED

    urdf: str
    srdf: str | None = None
    base: PoseModel = ORIGIN
    stopping: StoppingModel | None = None
    home: dict[str, Number] = field(default_factory=dict)
    packages: dict[str, str] = field(default_factory=dict)
    xacro_args: dict[str, str | bool | int | float] = field(default_factory=dict)
    # The default is that of the settings; a file may request less work.
    max_primitives: Annotated[int, Field(ge=1, le=64)]


@dataclass(frozen=True, kw_only=True)
class SensorEntry(SensorSettings):
    """A sensor of the scene, or a ring of sensors.

    Attributes:
        at: A pose in the link that carries it, or in the world.
    """

    __pydantic_config__ = CLOSED

    at: PoseModel = ORIGIN


@dataclass(frozen=True, kw_only=True)
class ZoneEntry(ZoneSettings):
    """A zone of sensed space.

    Attributes:
        at: Pose of its middle.
    """

    __pydantic_config__ = CLOSED

    at: PoseModel = ORIGIN


@dataclass(frozen=True, kw_only=True)
class SensingEntry(SensingSettings):
    """Sensed space of the scene.

    Attributes:
        zones: Zones by name; in several at once the first one counts.
    """

    __pydantic_config__ = CLOSED

    zones: Annotated[dict[str, ZoneEntry], Field(max_length=MOST_ZONES)] = field(
        default_factory=dict
    )

    def scene_zones(self) -> dict[str, SceneZone]:
        """The zones, as a scene has them."""
        return {
            name: SceneZone(**part_of(zone, ZoneSettings), pose=zone.at.pose())
            for name, zone in self.zones.items()
        }


class BufferEntry(Strict):
    """The distance of a pair [m]."""

    a: str
    b: str
    buffer: Annotated[NotNegative, METRES]


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
        sensors: Sensors by name.
        reflex: The reflex; none if it is left out.
        sensing: Sensed space; none if it is left out.
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
    buffer: Annotated[NotNegative, METRES] | None = None
    margin: Annotated[NotNegative, at_most(MOST_MARGIN, "m")] | None = None
    allow: list[Allowance] = Field(default=[])
    buffers: list[BufferEntry] = Field(default=[])
    index: IndexSettings = IndexSettings()
    sensors: Annotated[dict[str, SensorEntry], Field(max_length=MOST_SENSORS)] = Field(
        default={}
    )
    reflex: ReflexSettings | None = None
    sensing: SensingEntry | None = None


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


def stopping_arguments(model: StoppingModel, folder: Path) -> dict[str, Any]:
    """Figures that are given, by key, for `declared_figures`.

    Args:
        model: The entry.
        folder: Where the path of a table counts from.
    """
    tables = model.tables
    given: dict[str, Any] = model.model_dump(exclude_none=True, exclude={"tables"})
    if tables is not None:
        given["tables"] = tables
    if isinstance(tables, str):
        given["tables"] = TableFile(path=folder / tables)
    if isinstance(tables, TableFileModel):
        given["tables"] = TableFile(
            path=folder / tables.file, load=tables.load, extension=tables.extension
        )
    return given


def keys_of_figure(error: FiguresError, entry: Any) -> Keys:
    """Where in a robot's entry the figure is that an error is about.

    Args:
        error: The error.
        entry: The robot's `stopping` as the file has it, None if it has none.
    """
    figure = FIGURES.get(error.figure)
    keys = (figure.key if figure else error.figure).split(".") if error.figure else []
    for key in keys:
        entry = entry.get(key) if isinstance(entry, dict) else None
    by_joint = isinstance(entry, dict) and error.joint
    return ("stopping", *keys, *((error.joint,) if by_joint else ()))
