"""Settings are declared once: scene files, their JSON Schema and the page agree."""

import json
from dataclasses import MISSING, fields
from math import inf
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from armguard.errors import SceneError
from armguard.scene import Grasp, Gripper
from armguard.scene.file_models import SceneModel, scene_schema
from armguard.scene.schema import checked, meanings
from armguard.scene.sensing import (
    IntruderSettings,
    ReflexSettings,
    RegionSettings,
    SensingSettings,
    StartSettings,
    ZoneSettings,
)
from armguard.scene.sensors import RingSettings, SensorSettings
from armguard.scene.settings import (
    CycleSettings,
    IndexSettings,
    ObjectSettings,
    ResponseSettings,
    RobotSettings,
)

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "scene-file.md").read_text(encoding="utf-8")
SCHEMA = json.loads(json.dumps(scene_schema(), allow_nan=False))
KINDS = {"object": dict, "array": list, "string": str, "boolean": bool}
KINDS |= {"number": (int, float), "integer": int, "null": type(None)}


def wrong(value, node, path=""):
    """What a value violates of a JSON Schema; of what armguard's schemas consist of."""
    if "$ref" in node:
        node = {**SCHEMA["$defs"][node["$ref"].rsplit("/", 1)[1]], **node}
    found = []
    options = node.get("anyOf") or node.get("oneOf")
    if options and all(wrong(value, option, path) for option in options):
        found.append(f"{path} is none of its forms")
    kind = node.get("type")
    is_flag = isinstance(value, bool)
    if kind and (not isinstance(value, KINDS[kind]) or is_flag != (kind == "boolean")):
        return [*found, f"{path} is no {kind}"]
    if "enum" in node and value not in node["enum"]:
        found.append(f"{path} is none of {node['enum']}")
    for bound, kept in (
        ("minimum", lambda a, b: a >= b),
        ("maximum", lambda a, b: a <= b),
        ("exclusiveMinimum", lambda a, b: a > b),
    ):
        if bound in node and not kept(value, node[bound]):
            found.append(f"{path} is beyond its {bound}")
    if isinstance(value, list):
        inner = node.get("prefixItems") or [node.get("items", {})] * len(value)
        if len(inner) != len(value):
            found.append(f"{path} has another length")
        for k, item in enumerate(value[: len(inner)]):
            found += wrong(item, inner[k], f"{path}[{k}]")
    if isinstance(value, dict) and kind == "object":
        known, other = node.get("properties", {}), node.get("additionalProperties")
        found += [
            f"{path} lacks {k}" for k in node.get("required", ()) if k not in value
        ]
        for key, item in value.items():
            if key in known:
                found += wrong(item, known[key], f"{path}.{key}")
            elif other is False:
                found.append(f"{path} has no {key}")
            else:
                found += wrong(item, other or {}, f"{path}.{key}")
    return found


def scenes():
    """Every scene of the repository: files, and examples of pages."""
    files = [*ROOT.glob("src/**/*.yaml"), *ROOT.glob("docs/**/*.yaml")]
    texts = {str(f.relative_to(ROOT)): f.read_text(encoding="utf-8") for f in files}
    for page in (*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")):
        for k, part in enumerate(
            page.read_text(encoding="utf-8").split("```yaml\n")[1:]
        ):
            texts[f"{page.name}[{k}]"] = part.split("```")[0]
    return {name: text for name, text in texts.items() if "\nrobots:" in f"\n{text}"}


@pytest.mark.parametrize("name", scenes())
def test_every_scene_of_the_repository_follows_the_schema(name):
    values = YAML(typ="safe", pure=True).load(scenes()[name])
    assert wrong(values, SCHEMA) == []
    SceneModel.model_validate(values)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"mod": "path"}, " has no mod"),
        ({"mode": "paht"}, ".mode is none of"),
        ({"cycle": {"period": 0}}, ".cycle.period is beyond its exclusiveMinimum"),
        ({"objects": {"b": {"box": [1, 2]}}}, ".objects.b.box is none of its forms"),
        ({"robots": {"a": {}}}, ".robots.a lacks urdf"),
        ({"robots": {"a": {"urdf": "x", "response": {"evade_speed": 2}}}}, "response"),
    ],
)
def test_the_schema_refuses_what_a_file_may_not_have(change, says):
    values = {"robots": {"a": {"urdf": "panda"}}, **change}
    assert says in "\n".join(wrong(values, SCHEMA))


def test_the_schema_has_a_meaning_for_every_setting():
    settings = (CycleSettings, IndexSettings, RobotSettings, ObjectSettings)
    settings = (*settings, SensorSettings, RingSettings, ReflexSettings)
    settings = (*settings, SensingSettings, RegionSettings, IntruderSettings)
    settings = (*settings, StartSettings, ZoneSettings)
    for kind in (*settings, ResponseSettings, Grasp, Gripper):
        assert set(meanings(kind)) == {field.name for field in fields(kind)}
    assert SCHEMA["$defs"]["Grasp"]["properties"]["creep"] == {
        "default": 0.02,
        "description": "Greatest speed of a contact [m/s].",
        "exclusiveMinimum": 0.0,
        "title": "Creep",
        "type": "number",
    }


def in_words(value):
    """A default as the page has it."""
    if value is MISSING:
        return "required"
    if value is None or value == inf:
        return "–"
    if isinstance(value, ResponseSettings):
        return f"`{value.kind}`"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"`{list(value)}`"
    return f"`{value}`" if isinstance(value, str) else f"{value:g}"


@pytest.mark.parametrize(
    ("where", "kind"),
    [
        ("robots.NAME", RobotSettings),
        ("objects.NAME", ObjectSettings),
        ("robots.NAME.response", ResponseSettings),
        ("robots.NAME.gripper", Gripper),
        ("objects.NAME.graspable", Grasp),
        ("cycle", CycleSettings),
        ("index", IndexSettings),
        ("sensors.NAME", SensorSettings),
        ("sensors.NAME.ring", RingSettings),
        ("reflex", ReflexSettings),
        ("sensing", SensingSettings),
        ("sensing.region", RegionSettings),
        ("sensing.intruder", IntruderSettings),
        ("sensing.start", StartSettings),
        ("sensing.zones.NAME", ZoneSettings),
    ],
)
def test_the_page_has_every_key_with_its_default(where, kind):
    rows = [
        f"| `{field.name}` | {meanings(kind)[field.name].rstrip('.')} | "
        f"{in_words(field.default)} |"
        for field in fields(kind)
    ]
    table = "\n".join(
        (f"| under `{where}` | meaning | default |", "| --- | --- | --- |")
    )
    table = "\n".join((table, *rows, ""))
    assert table in PAGE, f"the page needs this table:\n\n{table}"


def test_the_page_names_all_other_keys():
    for name in (*SCHEMA["properties"], *SCHEMA["$defs"]["RobotEntry"]["properties"]):
        assert f"`{name}" in PAGE or f".{name}`" in PAGE, name


@pytest.mark.parametrize(
    ("settings", "under", "says"),
    [
        (ObjectSettings(buffer=-1), "", "buffer is -1 m; it must be finite and >= 0"),
        (ObjectSettings(top_speed=inf), "", "top_speed is inf m/s; it must be finite"),
        (ObjectSettings(stale=0), "", "stale is 0 s; it must be > 0"),
        (
            ObjectSettings(graspable=Grasp(creep=0.5)),
            "",
            "graspable.creep is 0.5 m/s; it must not exceed intent_speed, 0.1 m/s",
        ),
        (
            RobotSettings(gripper=Gripper(link="a", fingers=("b", "b"))),
            "",
            "gripper.fingers names a link twice",
        ),
        (ResponseSettings(far=0), "response", "response.far is 0; it must be > 0"),
        (
            ResponseSettings(evade_speed=2),
            "response",
            "response.evade_speed is 2.0; it must be in (0, 1]",
        ),
    ],
)
def test_a_setting_that_cannot_be_true_is_refused_in_python_too(settings, under, says):
    with pytest.raises(SceneError) as caught:
        checked("x", settings, under)
    assert str(caught.value) == f"x: {says}"


def test_settings_are_kept_in_the_form_in_which_they_are_declared():
    given = ObjectSettings(graspable=True, rests_on="table", stale=None)
    kept = checked("x", given)
    assert (kept.graspable, kept.rests_on, kept.stale) == (Grasp(), ("table",), inf)
    assert checked("x", kept) == kept
