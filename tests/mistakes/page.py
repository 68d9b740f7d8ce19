"""`docs/first-mistakes.md`: `python -m mistakes.page` in tests/ writes it anew."""

from pathlib import Path

from mistakes.calls import CALLS
from mistakes.clients import CLIENTS
from mistakes.cycles import CYCLES
from mistakes.messages import MESSAGES
from mistakes.motion_file import MOTION_FILE
from mistakes.robot_file import ROBOT_FILE
from mistakes.scene_file import SCENE_FILE

PAGE = Path(__file__).parents[2] / "docs" / "first-mistakes.md"

DOORS = {
    "Scene file": (
        SCENE_FILE,
        "`armguard check` prints these lines, with the line of the file.",
    ),
    "Robot file": (ROBOT_FILE, "`Scene.add_robot` and scene files read URDF."),
    "Motion file": (
        MOTION_FILE,
        "`armguard run` refuses the file. Arrays in NPZ files are checked likewise.",
    ),
    "Scene in Python": (
        CALLS,
        "Calls that build a scene raise an `ArmguardError`.",
    ),
    "Loop in Python": (
        CYCLES,
        "The loop raises no error: `verdict.why` has the line, and the robots stop. "
        "Calls between two cycles raise an `ArmguardError`.",
    ),
    "Service": (
        {**MESSAGES, **CLIENTS},
        "The client raises an `ArmguardError`, `Client.refusal` has the sentence of "
        "the service, or the call `why` has the line of the cycle. A warning about "
        "desired motion is the `remark` of `why`; the client logs one about a call.",
    ),
}

HEAD = """# First mistakes

A wrong unit, order or name is answered with the value, its place and the remedy. The
tables list what armguard says at each door; tests play every row.

A row with *warning* is a line in the log: the input is used, because it may be
intended. Desired motion in another unit is such a row. Robots follow it only up to
their limits and top speeds, and the log names it once.

armguard never proposes the name of another robot. It lists the known names.
"""


def page() -> str:
    """The page of all mistakes, in Markdown."""
    parts = [HEAD]
    for door, (mistakes, answered) in DOORS.items():
        parts.append(f"\n## {door}\n\n{answered}\n")
        parts.append("| mistake | value | place | remedy |\n| --- | --- | --- | --- |")
        for kind, mistake in mistakes.items():
            said = [f"`` {part.strip()} ``" for part in mistake[:3]]
            name = f"{kind}, *warning*" if mistake.logged else kind
            parts.append(f"| {name} | {' | '.join(said)} |")
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
