"""Planned stops of one joint, from numbers."""

import numpy as np

from armguard.kernel import kernel
from armguard.motion.figures import JointFigures
from armguard.motion.joint_stop import Order, farthest, plan_stop
from armguard.record import maker

new_figures = maker(JointFigures)


@kernel(entry=True)
def plan(v, against, driven, order, top, a, settle, curve, out):
    figures = new_figures()
    figures.velocity, figures.acceleration, figures.settle = top, a, settle
    figures.swing_share = settle / top
    figures.speed_up_way = 1.0 / a
    figures.return_way = 1.0 / a + 1.0 / order.most
    plan_stop(v, against, driven, order, figures, curve, out)


def planned(
    v, against, top, driven, a, reaction, ramp, passed, least, most, settle, time,
    curve, out,
):  # fmt: skip
    """Write the stop of a joint of these figures; see `plan_stop`."""
    order = Order(*map(float, (reaction, passed, ramp, least, most, time)))
    plan(v, against, driven, order, top, a, settle, curve, out)


@kernel(entry=True)
def write_curve(times, stop, out):
    for k in range(len(times)):
        out[k] = farthest(times[k], stop)


def curve(times, stop):
    """Farthest displacement of a joint at each time, without its settling."""
    out = np.zeros(len(times))
    write_curve(times, stop, out)
    return out
