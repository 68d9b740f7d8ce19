"""Requested twists of tools, converted to requested joint velocities.

Several tools of one robot are moved at once, as far as its joints permit.
"""

from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.state import Response
from armguard.respond.tool_motion import lead_tools, tool_columns


@kernel
def request_tools(a: Response, w: Workspace, m: Motion) -> None:
    """Write the requested velocities of all joints; zero for robots without a twist.

    Args:
        a: Responses; `twists` are written already, `requested` is written.
        w: Workspace, after a cycle was opened.
        m: Motion.
    """
    for j in range(a.requested.shape[0]):
        a.requested[j] = 0.0
    for r in range(a.notes.shape[0]):
        first = m.robot_figures[r].first_joint
        end = first + m.robot_figures[r].joint_count
        size = 0
        for t in range(a.request.twist_count):
            requested = a.twists[t]
            if requested.robot != r:
                continue
            p = (requested.point[0], requested.point[1], requested.point[2])
            body = requested.body
            tool_columns(body, p, first, end, size, a.tool_columns, w, m)
            for k in range(6):
                a.tool_speeds[size + k] = requested.twist[k]
            size += 6
        if size > 0:
            lead_tools(r, size, a.requested, a, w, m)
