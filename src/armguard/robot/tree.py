"""A robot is a tree: one root, every other link the child of one joint."""

from collections.abc import Mapping

from armguard.errors import ModelError
from armguard.robot.model import Joint, Link


def check_tree(
    file: str, links: Mapping[str, Link], joints: Mapping[str, Joint]
) -> str:
    """Name of the root link.

    Raises:
        ModelError: No link, two parents, a loop, or more than one root.
    """
    if not links:
        raise ModelError(f"'{file}' has no <link>")
    parent_of: dict[str, Joint] = {}
    for joint in joints.values():
        other = parent_of.get(joint.child)
        if other is not None:
            raise ModelError(
                f"'{file}' line {joint.line}: link '{joint.child}' is the child of "
                f"joint '{joint.name}' and of '{other.name}'; a link has one parent"
            )
        parent_of[joint.child] = joint
    for name in links:
        seen = [name]
        while seen[-1] in parent_of:
            above = parent_of[seen[-1]].parent
            if above in seen:
                loop = " -> ".join([*seen[seen.index(above) :], above])
                raise ModelError(
                    f"'{file}' line {parent_of[above].line}: links form a loop: {loop}"
                )
            seen.append(above)
    roots = [name for name in links if name not in parent_of]
    if len(roots) > 1:
        named = ", ".join(f"'{name}'" for name in roots)
        raise ModelError(
            f"'{file}' has {len(roots)} links without a parent: {named}; a robot has "
            "one root, join the others to it with joints"
        )
    return roots[0]
