"""SRDF: pairs whose check is switched off, and named configurations."""

from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path

from armguard.robot.model import DisabledPair, JointKind, RobotModel
from armguard.robot.xml_source import Element, Reader, read_xml

# How alike a wrong name must be to a right one to count as misspelt [-].
MISSPELT = 0.9

# Most names of other robots; each is compared with every link.
MOST_FOREIGN = 500


def load_srdf(path: Path, model: RobotModel) -> RobotModel:
    """The model with the disabled pairs and group states of an SRDF.

    A row may name links the URDF does not have: SRDFs are shared between variants of
    a robot, with and without a gripper. Such rows are left out with a note. A name
    that is almost one of the robot's is a misspelling, and an error.

    Raises:
        ModelError: The file is not an SRDF, or a name is misspelt.
    """
    return with_srdf(Reader(path.name), read_xml(path, "robot"), model)


def with_srdf(reader: Reader, root: Element, model: RobotModel) -> RobotModel:
    """The model with what a parsed SRDF says; see `load_srdf`."""
    pairs: list[DisabledPair] = []
    foreign: list[str] = []
    for element in root.iterchildren("disable_collisions"):
        names = [reader.attribute(element, key) for key in ("link1", "link2")]
        unknown = [name for name in names if name not in model.links]
        for name in unknown:
            near = get_close_matches(name, model.links, n=1, cutoff=MISSPELT)
            # Numbered links are alike but not misspelt: link7 is not link8.
            if near and digits(name) == digits(near[0]):
                raise reader.fail(
                    element,
                    f"link '{name}' does not exist; did you mean '{near[0]}'?",
                )
        if unknown:
            foreign += unknown
            if len(foreign) > MOST_FOREIGN:
                raise reader.fail(
                    element,
                    f"the rows before name {MOST_FOREIGN} links that do not exist; "
                    "this SRDF is of another robot",
                )
            continue
        reason = element.get("reason", "no reason given")
        pairs.append(DisabledPair(names[0], names[1], f"{reader.file}: {reason}"))
    states: dict[str, dict[str, float]] = {}
    for group in root.iterchildren("group_state"):
        positions = states.setdefault(reader.attribute(group, "name"), {})
        for joint in group.iterchildren("joint"):
            name = reader.attribute(joint, "name")
            known = model.joints.get(name)
            if known is None:
                foreign.append(name)
            elif known.kind is not JointKind.FIXED:
                (positions[name],) = reader.numbers(joint, "value", 1)
    notes = list(model.notes)
    if foreign:
        listed = ", ".join(f"'{name}'" for name in sorted(set(foreign))[:6])
        notes.append(
            f"'{reader.file}' speaks of {len(set(foreign))} names this robot does not "
            f"have ({listed}{', …' if len(set(foreign)) > 6 else ''}); those rows are "
            "left out"
        )
    return replace(
        model,
        disabled_pairs=tuple(dict.fromkeys(pairs)),
        group_states=states,
        notes=tuple(notes),
    )


def digits(name: str) -> str:
    """The digits of a name, in order."""
    return "".join(c for c in name if c.isdigit())
