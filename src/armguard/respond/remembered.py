"""Bounds of the integers of the responses in a checkpoint."""

import numpy as np

from armguard.guard.checkpoint_bounds import MOST_COUNTED, Greatest, Rules, Whole
from armguard.guard.levels import Reason
from armguard.respond import escape_state as escape
from armguard.respond import lead_state as lead
from armguard.respond import state
from armguard.respond.command import Blocked, Changed
from armguard.respond.engagement import Engagement
from armguard.respond.escape_ways import FORMS, GOES, SIDES
from armguard.scene.tables import SceneTables

FLAGS = (
    "gave_positions",
    "refused",
    "recovers",
    "violates",
    "overflows",
    "requests_motion",
    "coupled",
    "target_opens",
)

BOUNDS: Rules = {
    "response.notes": [
        Whole(0, max(Engagement), ("engagement",)),
        Whole(0, max(Blocked), ("blocked",)),
        Whole(0, state.ROWS, ("row_count",)),
        Whole(-1, 1, ("request_opens",)),
        Whole(0, 1, FLAGS),
        Whole(0, max(Reason), ("ordered_stop",)),
        Whole(0, int(~Changed(0)), ("changed",)),
    ],
    "response.request": [
        Whole(0, state.STANDSTILL, ("form",)),
        Whole(0, state.MOST_TWISTS, ("twist_count",)),
        Whole(0, max(Reason), ("stop_reason",)),
    ],
    "response.ways_out": [Whole(-1, state.EITHER_WAY)],
    "response.spare_of": [
        Whole(state.NEVER, "keys of pairs", ("key",)),
        Whole(state.NEVER, MOST_COUNTED, ("last_near",)),
    ],
    "lead.notes": [
        Whole(0, max(lead.Source), ("source",)),
        Whole(0, max(lead.Goal), ("goal",)),
        Whole(0, max(lead.Retreat), ("retreat",)),
        Whole(0, 1, ("suspended", "in_minimum", "begun", "released", "to_safe")),
        Whole(0, lead.TRAIL, ("unused", "count")),
        Whole(0, lead.TRAIL - 1, ("head",)),
        Whole(0, "bodies", ("tool_body",)),
    ],
    "escape.notes": [
        Whole(0, 1, ("evading", "has_motion")),
        Whole(0, "ways", ("next_candidate",)),
        Whole(0, "numbers of ways", ("best_candidate", "judged")),
    ],
}


def more_of(tables: SceneTables) -> Greatest:
    """Greatest values that these rules name, by robot where they differ."""
    joints = np.array([[part.joint_count] for part in tables.robots], dtype=np.int64)
    directions = FORMS * (SIDES + 1) + 2 * joints + 3 * escape.SPREADS
    count = len(tables.kinds)
    return {
        "keys of pairs": count << 32 | count,
        "ways": directions * len(GOES) - 1,
        "numbers of ways": directions * len(GOES),
    }
