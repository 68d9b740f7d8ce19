"""When a slide may go on, when its stop is done, and when it is not what was declared.

Each is tested just inside and just outside the bound that the figures give.
"""

import numpy as np
import pytest

from armguard.guard import Level, Reason
from armguard.guard.stops import order
from armguard.guard.watch import BRAKING, LOST, RESTING, RUNNING, STOPPING
from armguard.kernel import kernel
from sliding import (
    EXACT,
    MEASURED,
    UNTOLD_CYCLE,
    at_gap,
    let_go,
    motion_of,
    rest_of,
    slides,
    worst_stop,
)

PERIOD = 1e-3

# How far inside and outside a bound a slide is put [-].
SHARE = 0.01


@pytest.mark.parametrize("late", [0.0, 0.02])
def test_a_slide_at_rest_is_let_go_with_two_cycles_of_reserve(late):
    figures = {"acceleration": 50.0, "command": 0.01}
    guard = slides(figures, period=0.02, late=late)
    need, _ = worst_stop(figures, 0.0, figures["command"] + 2.0 * (0.02 + late))
    for share, phase in ((1.0 - SHARE, RESTING), (1.0 + SHARE, RUNNING)):
        guard.reset()
        guard.step(at_gap(share * need), 5.0, velocity=[0.0], now=5.0)
        assert guard._watch.phase[0] == phase


class Stopped:
    """A slide that is too near and too fast: its stop is ordered in the first cycle.

    Args:
        figures: What differs from `EXACT`.
        speed: Its speed [m/s].
        has_time: Whether the guard is given the time of a cycle.
    """

    def __init__(self, figures, speed, has_time=True):
        self.guard, self.speed, self.has_time = (
            slides(figures, period=PERIOD),
            speed,
            has_time,
        )
        self.f = {**EXACT, **figures}
        # On the clock of the stamps.
        self.effect = self.f["command"] + (0.0 if has_time else self.f["sensing"])
        cycle = PERIOD + (0.0 if has_time else UNTOLD_CYCLE * self.f["sensing"])
        need, _ = worst_stop(figures, speed, self.effect + cycle)
        self.begin = at_gap((1.0 - SHARE) * need)[0]
        let_go(self.guard)
        self.cycles = 0
        assert self.cycle(0.0, speed).reason in (Reason.TOO_CLOSE, Reason.NO_PROOF)

    def cycle(self, way, speed):
        """Verdict of a cycle in which it has got so far since the first one."""
        time = 5.0 + self.cycles * PERIOD
        self.cycles += 1
        now = time if self.has_time else None
        return self.guard.step([self.begin + way], time, velocity=[speed], now=now)

    def follow(self, motion, begin=0):
        """Levels of cycles in which it moves so from one of them on, until it rests."""
        times, speeds, ways = motion
        levels = []
        cycles = int(rest_of(times, speeds) / PERIOD) + 3
        for k in range(self.cycles, self.cycles + cycles):
            since = (k - begin) * PERIOD
            way, speed = np.interp(since, times, ways), np.interp(since, times, speeds)
            levels.append(self.cycle(begin * PERIOD * self.speed + way, speed).level)
        return levels


# Figures of stops, and what of them the slide does not quite keep: how far off.
STOPS = {
    "deceleration": ({"deceleration": 4.0}, "deceleration", 0.99),
    "delay": ({"command": 0.1}, "command", 1.01),
    "ramp": ({"ramp": 0.1, "command": 0.01}, "ramp", 1.01),
    "stop within its ramp": ({"ramp": 0.5, "command": 0.01}, "ramp", 1.01),
    "time that is unknown": ({"sensing": 0.1}, "sensing", 1.01),
}


@pytest.mark.parametrize("case", STOPS)
def test_a_stop_as_declared_is_believed_and_one_a_little_worse_is_not(case):
    figures, which, factor = STOPS[case]
    # Only its speed shows it, not where it gets to.
    figures = {**figures, "position_error": 0.02}
    has_time = which != "sensing"
    for share in (1.0, factor):
        true = {**figures, which: share * figures[which]}
        stopped = Stopped(figures, 1.0, has_time)
        effect = true.get("command", 0.0) + (0.0 if has_time else true["sensing"])
        levels = stopped.follow(motion_of(true, 1.0, 0.0, effect))
        assert (Level.BRAKE in levels) == (share != 1.0)
        assert (stopped.guard._watch.disproved[0] != 0) == (share != 1.0)


@pytest.mark.parametrize("ramp", [0.0, 0.1])
def test_a_stop_under_way_is_what_is_left_of_it_and_the_swing_it_began_with(ramp):
    figures = {"settle": 0.1, "settle_time": 0.1, "command": 0.01, "ramp": ramp}
    stopped = Stopped(figures, 1.0)
    times, speeds, ways = motion_of(figures, 1.0, 0.0, stopped.effect)
    swing = figures["settle"] * 1.0 / EXACT["velocity"]
    for k in range(1, 100):
        since = k * PERIOD
        way, speed = np.interp(since, times, ways), np.interp(since, times, speeds)
        pair = stopped.cycle(way, speed).nearest
        need = ways[-1] - way + swing
        assert pair.distance - pair.headroom == pytest.approx(need, abs=1e-5)


@pytest.mark.parametrize("share", [0.6, 1.0, 1.15])
def test_a_measured_stop_is_believed_until_its_time_whatever_it_does_till_then(share):
    figures = {"tables": {"joint": MEASURED}, "command": 0.02}
    speed, way, time = 1.0, 0.2, 0.4
    guard = slides(figures, period=PERIOD)
    begin = at_gap((1.0 - SHARE) * (speed * (0.02 + PERIOD) + way))[0]
    let_go(guard)
    times = np.array([0.0, 0.02, 0.02 + share * time])
    ways = np.array([0.0, 0.02 * speed, 0.02 * speed + way])
    for k in range(int(times[-1] / PERIOD) + 3):
        # Slowly all the way, and then at rest at once.
        since = k * PERIOD
        v = speed if since < times[1] + 1e-9 else way / (share * time)
        v = v if since < times[2] else 0.0
        q = begin + np.interp(since, times, ways)
        guard.step([q], 5.0 + since, velocity=[v], now=5.0 + since)
    assert (guard._watch.disproved[0] != 0) == (share > 1.0)


@pytest.mark.parametrize("leap", [0.0, 0.1])
def test_stamps_that_leap_alone_do_not_make_a_liar_of_a_stop(leap):
    """Without a time, the time may have passed: then the slide should rest by now."""
    figures = {"sensing": 0.01, "position_error": 0.05}
    stopped = Stopped(figures, 0.5, has_time=False)
    times, speeds, ways = motion_of(figures, 0.5, 0.0, stopped.effect)
    for k in range(1, int(rest_of(times, speeds) / PERIOD)):
        since = k * PERIOD
        q = stopped.begin + np.interp(since, times, ways)
        stamp = 5.0 + since + leap * (k >= 25)
        stopped.guard.step([q], stamp, velocity=[np.interp(since, times, speeds)])
    assert stopped.guard._watch.disproved[0] == 0


@pytest.mark.parametrize("which", ["brake_deceleration", "brake_delay"])
def test_a_brake_as_declared_is_believed_and_one_a_little_worse_is_not(which):
    figures = {"brake_deceleration": 5.0, "brake_delay": 0.1}
    for share in (1.0, 0.99 if which == "brake_deceleration" else 1.01):
        true = {**figures, which: share * figures[which]}
        stopped = Stopped(figures, 1.0)
        while stopped.cycle(stopped.cycles * PERIOD, 1.0).level < Level.BRAKE:
            assert stopped.cycles < 100
        braked = {"deceleration": true["brake_deceleration"]}
        motion = motion_of(braked, 1.0, 0.0, true["brake_delay"])
        levels = stopped.follow(motion, begin=stopped.cycles - 1)
        assert (Level.HARDWARE_STOP in levels) == (share != 1.0)


# Slides that may swing as fast as they move: only their positions show their stops.
SWINGS = [
    {},
    {"position_error": 0.01},
    {"ramp": 0.05},
]


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("more", SWINGS)
def test_stops_and_brakes_are_believed_as_far_as_they_may_get(more, sign):
    speed, which_slide = 0.8, 0 if sign > 0.0 else 1
    swing = {"settle": 0.02, "settle_time": 0.1}
    brake = {"brake_delay": 0.02, "brake_deceleration": 5.0}
    figures = {**swing, **brake, "command": 0.01, **more}
    f = {**EXACT, **figures}
    guard = slides(figures, figures, period=PERIOD)
    need, _ = worst_stop(figures, speed, f["command"] + PERIOD)
    reach, _ = worst_stop(figures, speed, f["command"])
    # It may be measured too little at first, and too much at the end.
    stop = reach + f["position_error"]
    brake = speed * f["brake_delay"] + 0.5 * speed**2 / f["brake_deceleration"]
    brake += f["settle"] + 2.0 * f["position_error"]
    begin = at_gap((1.0 - SHARE) * (need + f["position_error"]), 2)
    let_go(guard)
    ways = {}
    for k in range(300):
        way, time = k * PERIOD * speed, 5.0 + k * PERIOD
        q, velocity = np.array(begin), np.zeros(2)
        q[which_slide] += sign * way
        velocity[which_slide] = sign * speed
        guard.step(q, time, velocity=velocity, now=time)
        ways.setdefault(int(guard._watch.phase[which_slide]), way)
        if LOST in ways:
            break
    assert ways[STOPPING] == 0.0
    assert stop < ways[BRAKING] <= stop + speed * PERIOD
    assert brake < ways[LOST] - ways[BRAKING] <= brake + speed * PERIOD


# Figures of stops, and how long after their order they are done [s]. The slide is found
# at rest from the cycle after that on.
DONE = {
    "settling": ({"settle_time": 0.0495}, 0.05 + PERIOD),
    "order": ({"command": 0.0495}, 0.05),
    "five cycles": ({}, 5.0 * PERIOD),
}


@pytest.mark.parametrize("case", DONE)
def test_a_stop_is_done_as_soon_as_it_surely_is_and_no_earlier(case):
    figures, time = DONE[case]
    stopped = Stopped({"acceleration": 20.0, **figures}, 0.0)
    while stopped.guard._watch.phase[0] == STOPPING:
        stopped.cycle(0.0, 0.0)
        assert stopped.cycles < 100
    assert (stopped.cycles - 1) * PERIOD == pytest.approx(time, abs=1e-9)
    assert stopped.guard._watch.phase[0] == RESTING


# A slide of 1 m/s swings by 5 cm, and is braked by 20 m/s² at most.
SWINGING = {"settle": 0.1, "settle_time": 0.1, "command": 0.01}


@pytest.mark.parametrize("share", [1.0, 1.03])
def test_a_swing_back_past_where_the_stop_was_ordered_is_believed_up_to_its_bound(
    share,
):
    speed, hardest = 1.0, EXACT["deceleration_most"]
    stopped = Stopped(SWINGING, speed)
    rest, way = speed / hardest, 0.5 * speed**2 / hardest
    swing = share * SWINGING["settle"] * speed / EXACT["velocity"]
    assert swing > 1.5 * way
    for k in range(1, 200):
        since = k * PERIOD
        at = min(since, rest)
        q, v = speed * at - 0.5 * hardest * at**2, speed - hardest * at
        turn = np.pi * (since - rest) / SWINGING["settle_time"]
        if 0.0 < turn < np.pi:
            q -= swing * np.sin(turn) ** 2
            v -= swing * np.pi / SWINGING["settle_time"] * np.sin(2.0 * turn)
        stopped.cycle(q, v)
    assert (stopped.guard._watch.disproved[0] != 0) == (share > 1.0)


def test_a_slide_that_leaves_is_thought_to_swing_back_when_it_is_stopped_hard():
    guard = slides(SWINGING, period=PERIOD)
    speed = 0.5
    back = SWINGING["settle"] * speed / EXACT["velocity"]
    back -= 0.5 * speed**2 / EXACT["deceleration_most"]
    for share, kept in ((0.97, False), (1.03, True)):
        let_go(guard)
        pair = guard.step(at_gap(share * back), 5.0, velocity=[-speed], now=5.0).nearest
        assert pair.needed == pytest.approx(back, rel=1e-6)
        assert (pair.headroom >= 0.0) == kept


def test_a_measured_stop_that_begins_at_once_and_lingers_is_as_declared():
    # Whatever the speed, a stop takes nearly the same time: it is slow at its end.
    speeds = np.linspace(0.125, 2.0, 16)
    table = [(v, 0.3 + 0.05 * v, 0.1 * v * v + 0.05 * v) for v in speeds.tolist()]
    figures = {"tables": {"joint": table}, "command": 0.02}
    for share in (1.0, 1.1):
        guard = slides(figures, period=PERIOD)
        begin = at_gap(0.15)[0]
        let_go(guard)
        ends = share * (0.3 + 0.05 + figures["command"]) - 1e-9
        q = begin
        for k in range(int(ends / PERIOD) + 3):
            since = k * PERIOD
            v = max(1.0 - since / 0.01, 0.1) if since < ends else 0.0
            guard.step([q], 5.0 + since, velocity=[v], now=5.0 + since)
            assert k > 0 or guard._watch.phase[0] == STOPPING
            q += v * PERIOD
        assert (guard._watch.disproved[0] != 0) == (share > 1.0)


@pytest.mark.parametrize("table", [False, True])
def test_a_slide_that_moved_at_rest_may_get_as_far_as_a_table_leads_but_no_figure(
    table,
):
    """By its figures this slide stops within 15 mm, by its table in a third of a s."""
    figures = {"deceleration": 50.0, "deceleration_most": 100.0, "command": 0.01}
    if table:
        figures["tables"] = {"joint": MEASURED}
    guard, speed = slides(figures, period=PERIOD), 0.8
    for k in range(200):
        time = 5.0 + k * PERIOD
        guard.step([k * PERIOD * speed], time, velocity=[speed], now=time)
        assert guard._watch.phase[0] != RESTING or k == 0
    assert (guard._watch.disproved[0] == 0) == table


@pytest.mark.parametrize("moved", [False, True])
def test_a_stop_under_way_is_named_as_such_but_not_of_a_slide_that_moved_at_rest(moved):
    guard, speed = slides({"command": 0.05}, period=PERIOD), 0.5 * moved
    if moved:
        known = first = Reason.MOVED_AT_REST
    else:
        # It was let go, and the next cycle comes too late.
        guard.step([0.0], 5.0 - 10.0 * PERIOD, velocity=[0.0], now=5.0 - 10.0 * PERIOD)
        known, first = Reason.STOPPING, Reason.CYCLE_LATE
    for k in range(4):
        time = 5.0 + k * PERIOD
        q = [speed * k * PERIOD]
        verdict = guard.step(q, time, velocity=[speed], now=time)
        assert verdict.reason is (known if k else first)


@kernel(entry=True)
def order_brake(v, m):
    """Order the brake of the first robot at 5 s."""
    order(0, BRAKING, 30, 5.0, v, m)


@pytest.mark.parametrize("speed", [-1.5, -0.4, 0.4, 1.5])
def test_a_brake_leads_no_farther_than_its_delay_and_its_deceleration(speed):
    brake = {"brake_delay": 0.02, "brake_deceleration": 5.0}
    figures = {**brake, "acceleration": 20.0, "settle": 0.01, "position_error": 1e-3}
    guard, place = slides({**figures, "velocity_error": 0.05}, period=PERIOD), 0.3
    guard.step([place], 5.0, velocity=[speed], now=5.0)
    order_brake(guard._watch, guard._motion)
    for sign, bound in ((1.0, guard._watch.rest_high), (-1.0, guard._watch.rest_low)):
        # Until the brake works it may be driven either way.
        towards = max(sign * speed + 0.05, 0.0)
        after = min(towards + 20.0 * 0.02, EXACT["velocity"])
        way = after * 0.02 + 0.5 * after**2 / 5.0
        known = place + sign * (way + 0.01 + 2e-3)
        assert bound[0] == pytest.approx(known, abs=1e-6)
