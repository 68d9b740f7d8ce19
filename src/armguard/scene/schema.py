"""Types of declared settings: bounded numbers, and in words what is wrong with a value.

A setting is declared once, as an attribute of a dataclass: its type has the bounds, the
class's docstring the meaning and the unit. Python, scene files and the JSON Schema
take all from there.
"""

import re
from collections.abc import Mapping
from functools import cache
from inspect import getdoc
from math import radians
from reprlib import Repr
from typing import Annotated, Any, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    TypeAdapter,
    ValidationError,
)

from armguard.errors import SceneError, did_you_mean
from armguard.scene.yaml_source import SceneFileError, YamlSource

Settings = TypeVar("Settings")
Plain = TypeVar("Plain")
Mapped = TypeVar("Mapped")
Model = TypeVar("Model", bound="Strict")


def no_flag(value: Any) -> Any:
    """Refuses true and false, which are no numbers."""
    if isinstance(value, bool):
        raise ValueError(f"expected a number, got {str(value).lower()}")
    return value


NO_FLAG = BeforeValidator(no_flag)
Number = Annotated[float, Field(allow_inf_nan=False), NO_FLAG]
Positive = Annotated[float, Field(allow_inf_nan=False, gt=0.0), NO_FLAG]
NotNegative = Annotated[float, Field(allow_inf_nan=False, ge=0.0), NO_FLAG]
Name = Annotated[str, Field(min_length=1)]

# Greatest times [s], distances [m], speeds [m/s] and angles [rad] that are declared; a
# larger one is in other units.
MOST_SECONDS, MOST_METRES, MOST_MARGIN = 2.0, 2.0, 10.0
MOST_SPEED, TURN = 100.0, 6.2832

# A period or a delay of a cycle as long as this is probably in milliseconds [s].
LEAST_UNLIKELY = 0.9

# Greatest overlap of a contact [m] and closing speed at it [m/s].
MOST_OVERLAP, MOST_CREEP = 0.2, 2.0

# Of a mapping without unknown keys. Instances are validated too: making one is not.
CLOSED = ConfigDict(extra="forbid", frozen=True, revalidate_instances="always")

# How values appear in messages.
BRIEF = Repr()
BRIEF.maxlevel = 2

# An attribute of a docstring and what it means, which ends in its unit.
ATTRIBUTE = re.compile(r"^    (\w+): (.*(?:\n {6,}.*)*)", re.MULTILINE)
UNIT = re.compile(r"\[([^] -]+)\]\.?$")

# What a value is expected to be, by the type of pydantic's finding.
EXPECTED = {
    "a number": ("float_parsing", "float_type", "int_parsing", "int_type"),
    "a list": ("list_type", "tuple_type"),
    "a mapping": ("model_type", "dataclass_type", "dict_type"),
    "text": ("string_type",),
    "true or false": ("bool_parsing", "bool_type"),
}
# Remedies for missing keys that need an explanation.
REMEDIES = {
    "unknown": "; state how space counts that no sensor has seen: free, still or moving"
}
SIGNS = {"greater_than": ">", "greater_than_equal": ">=", "less_than_equal": "<="}


def in_other_units(value: float, unit: str) -> str:
    """A value that is too large in its unit, and the number that is intended."""
    if unit == "s":
        return (
            f"is {value:g} s, which looks like milliseconds or hertz; give seconds: "
            f"{value:g} ms are {value * 1e-3:g}, "
            f"at {value:g} Hz it is {1.0 / value:.4g}"
        )
    if unit == "rad":
        return (
            f"is {value:g} rad, which looks like degrees; give radians: "
            f"{radians(value):.4f}"
        )
    return (
        f"is {value:g} {unit}, which looks like millimetres; give metres: "
        f"{value * 1e-3:g}"
    )


def at_most(greatest: float, unit: str) -> AfterValidator:
    """Refuses a number that is so large that it is in other units."""

    def check(value: float) -> float:
        if abs(value) > greatest:
            raise ValueError(in_other_units(value, unit))
        return value

    return AfterValidator(check)


SECONDS = at_most(MOST_SECONDS, "s")
METRES = at_most(MOST_METRES, "m")
SPEED = at_most(MOST_SPEED, "m/s")
Angle = Annotated[Number, at_most(TURN, "rad")]


class Strict(BaseModel):
    """A mapping without unknown keys."""

    model_config = CLOSED


def counted(count: int) -> BeforeValidator:
    """Refuses a list of another length, as a whole."""

    def check(value: Any) -> Any:
        if isinstance(value, list | tuple) and len(value) != count:
            raise ValueError(f"expected {count} numbers, got {len(value)}")
        return value

    return BeforeValidator(check)


Triple = Annotated[tuple[Number, Number, Number], counted(3)]
Angles = Annotated[tuple[Angle, Angle, Angle], counted(3)]
PositiveTriple = Annotated[tuple[Positive, Positive, Positive], counted(3)]
Quaternion = Annotated[tuple[Number, Number, Number, Number], counted(4)]


def form_of(value: Any) -> str:
    """Which branch of a union a value is for: the mapping or the other one."""
    return "branch-mapping" if isinstance(value, dict) else "branch-plain"


# A value in one of two forms, of which one is a mapping.
ByForm = Annotated[
    Annotated[Plain, Tag("branch-plain")] | Annotated[Mapped, Tag("branch-mapping")],
    Discriminator(form_of),
]

# A number for all joints, or one by joint name.
ByJoint = ByForm[Plain, dict[str, Plain]]


def model_of(source: YamlSource, model: type[Model], entry: type[Strict]) -> Model:
    """The values of a YAML file, checked against a model.

    Args:
        source: The file.
        model: The model.
        entry: Model of the entries below its keys.

    Raises:
        SceneFileError: They do not follow it.
    """
    if not isinstance(source.values, dict):
        needed = [key for key, one in model.model_fields.items() if one.is_required()]
        names = " and ".join(f"'{key}'" for key in needed)
        raise source.problem(
            (), f"must be a mapping with the key{'s' * (len(needed) > 1)} {names}"
        )
    try:
        return model.model_validate(source.values)
    except ValidationError as errors:
        found = errors.errors(include_url=False)
    problems = []
    for error in found:
        keys, sentence = keys_of(error["loc"]), sentence_of(dict(error))
        if error["type"] == "extra_forbidden":
            known = (model if len(keys) == 1 else entry).model_fields
            sentence = f"there is no such key; {did_you_mean(str(keys[-1]), known)}"
        problems.append(source.found(keys, sentence))
    raise SceneFileError(problems)


def keys_of(location: tuple[str | int, ...]) -> tuple[str | int, ...]:
    """Keys of pydantic's path, without the names of branches of unions."""
    return tuple(
        key for key in location if isinstance(key, int) or not key.startswith("branch-")
    )


def sentence_of(error: dict[str, Any]) -> str:
    """One of pydantic's findings in our words, to follow a key."""
    kind, got, context = str(error["type"]), error.get("input"), error.get("ctx", {})
    for expected, kinds in EXPECTED.items():
        if kind in kinds and got is None:
            return f"is empty; delete the key, or give {expected}"
        if kind in kinds:
            return f"expected {expected}, got {BRIEF.repr(got)}"
    if kind == "missing":
        return f"is missing{REMEDIES.get(error['loc'][-1], '')}"
    if kind == "too_long":
        return f"has {len(got or ()):,} entries; the limit is {context['max_length']:,}"
    if kind == "too_short":
        return f"needs at least {context['min_length']}"
    if kind == "finite_number":
        return f"is {got}; it must be finite"
    if kind in SIGNS:
        bound = next(context[key] for key in ("gt", "ge", "le") if key in context)
        return f"is {BRIEF.repr(got)}; it must be {SIGNS[kind]} {bound:g}"
    if kind == "string_too_short":
        return "must not be empty"
    if kind == "literal_error":
        return f"is {BRIEF.repr(got)}; it must be {context['expected']}"
    return str(error["msg"]).removeprefix("Value error, ")


@cache
def adapter(kind: Any) -> TypeAdapter[Any]:
    """What validates a class of settings."""
    return TypeAdapter(kind)


def checked(
    owner: str,
    settings: Settings | Mapping[str, Any],
    under: str = "",
    kind: type[Settings] | None = None,
) -> Settings:
    """Settings that can be true, each in the form in which it is declared.

    Args:
        owner: Whose they are, for messages.
        settings: The settings, or a mapping with their keys.
        under: What these are of their owner, such as "response".
        kind: Class of the settings of a mapping.

    Raises:
        SceneError: One cannot be true.
    """
    declared: Any = kind or type(settings)
    try:
        valid: Settings = adapter(declared).validate_python(settings)
        return valid
    except ValidationError as errors:
        error = errors.errors(include_url=False)[0]
    keys, sentence = keys_of(error["loc"]), sentence_of(dict(error))
    if error["type"] == "unexpected_keyword_argument":
        path = ".".join(filter(None, (under, *map(str, keys))))
        known = (
            did_you_mean(str(keys[-1]), meanings(declared)) if len(keys) == 1 else ""
        )
        said = "; ".join(filter(None, ("there is no such key", known)))
        raise SceneError(f"{owner}: {path}: {said}")
    is_own = error["type"] == "value_error"
    if keys and not is_own:
        unit = UNIT.search(meanings(declared).get(str(keys[-1]), ""))
        if unit is not None:
            sentence = sentence.replace(";", f" {unit[1]};", 1)
    if keys and sentence.startswith(f"{keys[-1]} "):
        keys = keys[:-1]
    sentence = sentence.replace("must be >= 0", "must be finite and >= 0")
    path = ".".join(filter(None, (under, *map(str, keys))))
    if path:
        path += "." if is_own and not sentence.startswith("is ") else " "
    raise SceneError(f"{owner}: {path}{sentence}")


def meanings(kind: type) -> dict[str, str]:
    """What each attribute of a class means, from the docstrings of it and its bases."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        attributes = (getdoc(base) or "").partition("Attributes:\n")[2]
        if "__doc__" in vars(base):
            found |= {
                name: " ".join(text.split())
                for name, text in ATTRIBUTE.findall(attributes)
            }
    return found


def part_of(settings: Any, kind: type[Any]) -> dict[str, Any]:
    """Those attributes of settings that a base of their class declares."""
    return {name: getattr(settings, name) for name in kind.__dataclass_fields__}
