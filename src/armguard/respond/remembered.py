"""Bounds of the integers of the responses in a checkpoint."""

import numpy as np

from armguard.guard.checkpoint_bounds import MOST_COUNTED, Greatest, Rules, Whole
from armguard.guard.levels import Reason
from armguard.respond import escape_state as escape
from armguard.respond import lead_state as lead
from armguard.respond import state
from armguard.respond.command import Blocked, Changed
from armguard.respond.engagement import Standing
from armguard.respond.escape_ways import FORMS, GOES, SIDES
from armguard.scene.tables import SceneTables

FLAGS = (
    state.GAVE_POSITIONS,
    state.REFUSED,
    state.RETREATS,
    state.BREAKS,
    state.CROWDED,
    state.ASKS,
    state.TANGLED,
    state.OPENS,
)

BOUNDS: Rules = {
    "response.notes": [
        Whole(0, max(Standing), (state.STATE,)),
        Whole(0, max(Blocked), (state.BLOCKED,)),
        Whole(0, state.ROWS, (state.ROW_COUNT,)),
        Whole(-1, 1, (state.LEADS_AWAY,)),
        Whole(0, 1, FLAGS),
        Whole(0, max(Reason), (state.ORDERED,)),
        Whole(0, int(~Changed(0)), (state.CHANGED,)),
    ],
    "response.asking": [
        Whole(0, state.STANDSTILL, (state.FORM,)),
        Whole(0, state.MOST_TWISTS, (state.TWIST_COUNT,)),
        Whole(0, max(Reason), (state.STOP_REASON,)),
    ],
    "response.ways_out": [Whole(-1, state.EITHER_WAY)],
    "response.spare_of": [
        Whole(state.NEVER, "keys of pairs", (state.PAIR_KEY,)),
        Whole(state.NEVER, MOST_COUNTED, (state.MET,)),
    ],
    "lead.notes": [
        Whole(0, lead.BY_RETREAT, (lead.LED,)),
        Whole(0, lead.TOOL_GOAL, (lead.GOAL,)),
        Whole(0, lead.ENDS, (lead.WAY,)),
        Whole(
            0,
            1,
            (lead.SUSPENDED, lead.IN_MINIMUM, lead.BEGUN, lead.LET_GO, lead.THEN_SAFE),
        ),
        Whole(0, lead.TRAIL, (lead.KEEP, lead.COUNT)),
        Whole(0, lead.TRAIL - 1, (lead.HEAD,)),
        Whole(0, "bodies", (lead.TOOL_BODY,)),
    ],
    "escape.notes": [
        Whole(0, 1, (escape.EVADING, escape.HAS_WAY)),
        Whole(0, "ways", (escape.NEXT_TRY,)),
        Whole(0, "numbers of ways", (escape.KNOWN, escape.TRIED)),
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
