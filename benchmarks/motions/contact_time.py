"""Time to contact: never given longer than it is, and how much shorter."""

from typing import Any, NamedTuple

import numpy as np

from armguard.cli.console import say
from armguard.guard import layout
from armguard.guard.layout import IN_NEAR
from armguard.respond import Guard
from armguard.scene import bay_scene
from arrays import Floats
from episodes.follower import Arms
from motions.free_motion import Motion, safe_time, state_at
from motions.judge import Judge

# How far away pairs are reported, and motions are looked at [m].
MARGIN = 0.15

# Longest motion [s], densest samples [s], and to what a contact is narrowed down [s].
HORIZON = 0.3
GRAIN = 2e-4
NARROW = 1e-6

# Motions of a state, every how many of them is followed to the horizon, and how far
# joints are off home [rad].
MOTIONS = 200
TO_THE_END = 10
OFF_HOME = 1.2

# Shares of the top speed states have [-].
SPEEDS = (0.05, 0.2, 0.5, 1.0)

# What a motion does with its joints, and how often.
KINDS = {
    "steady": 0.25,
    "even": 0.25,
    "bang-bang": 0.25,
    "towards": 0.25,
}

# Motions are led at one of so many of the nearest pairs.
FEW = 8

# Share of states whose measurements are as late and as wrong as declared [-].
WRONG = 0.2

# Motions from states that are about to touch: how near [m], steps to get there.
CLOSE = 2000
ABOUT = (3e-4, 4e-3)
CLOSING = 6

# Approaches of each way, their speed [m/s], and to how near they lead [m].
APPROACHES = 100
SPEED = 0.1
NEAREST = 0.005
FARTHEST = 0.12
PERIOD = 0.001
TIP = np.array([0.0, 0.0, 0.13])

# Fewest cycles of an approach that counts; how flat a direction may be that the arm
# still goes in [-].
SHORTEST = 50
FLAT = 0.05


class Estimate(NamedTuple):
    """What a verdict says of a pair.

    Attributes:
        pair: Where it is in the judge's pairs.
        time: Time to contact [s].
        distance: Distance [m].
    """

    pair: int
    time: float
    distance: float


def primitives(verdict: Any, k: int) -> tuple[int, int]:
    """Numbers of the primitives of a verdict's k-th near pair."""
    row = verdict._data[verdict._names.first_row + k * layout.NEAR_WIDTH :]
    return int(row[IN_NEAR.first]), int(row[IN_NEAR.second])


class Bay(Arms):
    """The bay with its guard and its judge; see also `Arms`.

    Attributes:
        guard: The guard.
        judge: The judge.
        top: Top speeds, shape (n,) [rad/s].
        hardest: Greatest accelerations, shape (n,) [rad/s²].
        q_error: Greatest errors of positions, shape (n,) [rad].
        v_error: Greatest errors of velocities, shape (n,) [rad/s].
        age: Greatest age of a measurement [s].
        now: Time of the last cycle [s].
    """

    def __init__(self) -> None:
        scene = bay_scene("path")
        scene._margin = MARGIN
        self.guard = Guard(scene, self_test=False)
        super().__init__(self.guard.tables)
        self.judge = Judge(scene, self.tables)
        self.top, self.hardest = self.joined("velocity"), self.joined("acceleration")
        self.q_error = self.joined("position_error")
        self.v_error = self.joined("velocity_error")
        self.age = self.figures[self.robots[0]].sensing
        self.now = 0.0

    def ask(self, q: Floats, v: Floats, age: float = 0.0) -> list[Estimate]:
        """What the guard says of every near pair, nearest first."""
        self.now += 1.0
        self.guard.reset()
        verdict = self.guard.step(q, self.now - age, velocity=v, now=self.now)
        return sorted(self.estimates(verdict), key=lambda t: t.distance)

    def ask_wrong(self, q: Floats, v: Floats, outward: Floats) -> list[Estimate]:
        """The same where a pair is measured as far, slow and late as it may be.

        Args:
            q: True positions at the stamp.
            v: True velocities at the stamp.
            outward: Gradient of the pair's distance.
        """
        wrong = np.sign(outward)
        return self.ask(q + wrong * self.q_error, v + wrong * self.v_error, self.age)

    def estimates(self, verdict: Any) -> list[Estimate]:
        """Pairs of a verdict that are apart."""
        return [
            Estimate(
                self.judge.place_of(*primitives(verdict, k)),
                pair.time_to_contact,
                pair.primitive_distance,
            )
            for k, pair in enumerate(verdict.near)
            if pair.primitive_distance > 0.0
        ]

    def draw(self, rng: np.random.Generator) -> Floats:
        """Random joint positions in which nothing touches and something is near."""
        home = self.guard.home
        while True:
            q = home + rng.uniform(-OFF_HOME, OFF_HOME, len(home))
            q = np.clip(q, self.lower, self.upper)
            self.judge.place(q)
            if 0.0 < float(self.judge.gaps().min()) < MARGIN:
                return q

    def gap_at(self, t: float, motion: Motion, pair: int, state: Floats) -> float:
        """Distance of a pair at a time of a motion; its state is written [m]."""
        state_at(t, motion, state)
        self.judge.place(state[0])
        return self.judge.gap(pair)

    def contact(self, motion: Motion, pair: int, horizon: float) -> float:
        """When a pair first touches [s]; infinite if not within the horizon [s]."""
        levers, state = self.judge.levers[pair], np.zeros((2, len(motion.q)))
        hardest = np.maximum(np.abs(motion.first), np.abs(motion.then))
        before = t = 0.0
        while True:
            gap = self.gap_at(t, motion, pair, state)
            if gap <= 0.0:
                return self.narrowed(motion, pair, before, t)
            if t >= horizon:
                return np.inf
            before = t
            t = min(t + max(safe_time(gap, levers, hardest, state), GRAIN), horizon)

    def narrowed(self, motion: Motion, pair: int, low: float, high: float) -> float:
        """When a pair that is apart at one time and touches at a later one does so."""
        state = np.zeros((2, len(motion.q)))
        while high - low > NARROW:
            middle = 0.5 * (low + high)
            if self.gap_at(middle, motion, pair, state) <= 0.0:
                high = middle
            else:
                low = middle
        return high


def draw_motion(
    kind: str, q: Floats, v: Floats, outward: Floats, bay: Bay, rng: np.random.Generator
) -> Motion:
    """A random motion from a state.

    Args:
        kind: See `KINDS`.
        q: Joint positions.
        v: Velocities.
        outward: Gradient of the pair's distance.
        bay: The bay.
        rng: Of the motion.
    """
    n = len(q)
    first = np.zeros(n)
    if kind == "even":
        first = rng.uniform(-1.0, 1.0, n) * bay.hardest
    elif kind == "bang-bang":
        first = rng.choice([-1.0, 1.0], n) * bay.hardest
    elif kind == "towards":
        first = -np.sign(outward) * bay.hardest
    then = -first if kind == "bang-bang" else first
    switch = rng.uniform(0.0, HORIZON, n)
    return Motion(q, v, first, then, switch, bay.top)


class Row(NamedTuple):
    """What came of a motion.

    Attributes:
        exact: Whether measurements were.
        kind: See `KINDS`.
        approaches: Whether the state comes nearer to the pair by all its joints.
        followed: Whether it was followed to the horizon, or only for the time given.
        given: Time to contact that was given [s].
        true: True one, infinite if there was none while it was followed [s].
    """

    exact: bool
    kind: str
    approaches: bool
    followed: bool
    given: float
    true: float


def contact_figures(count: int, seed: int) -> dict[str, Any]:
    """Times to contact of random motions, given and true.

    Args:
        count: Motions.
        seed: Of the motions.
    """
    rng, bay = np.random.default_rng(seed), Bay()
    rows: list[Row] = []
    states = 0
    while len(rows) < count:
        if states % 250 == 0:
            say(f"{len(rows)} of {count} motions")
        states += 1
        rows += state_rows(bay, rng)
    exact = [row for row in rows if row.exact]
    return {
        "motions": len(rows),
        "states": states,
        "horizon_s": HORIZON,
        "margin_mm": MARGIN * 1e3,
        "all": summed_up(exact),
        "approaches": summed_up([row for row in exact if row.approaches]),
        "kinds": {
            kind: summed_up([row for row in exact if row.kind == kind])
            for kind in KINDS
        },
        "age_ms": bay.age * 1e3,
        **wrong_figures(rows, bay),
        "close": close_figures(bay, rng),
    }


def wrong_figures(rows: list[Row], bay: Bay) -> dict[str, Any]:
    """Figures of wrong measurements, from their stamp and from the cycle."""
    wrong = [row for row in rows if not row.exact]
    later = [row._replace(true=max(row.true - bay.age, 0.0)) for row in wrong]
    return {"wrong_from_stamp": summed_up(wrong), "wrong_from_cycle": summed_up(later)}


def state_rows(bay: Bay, rng: np.random.Generator) -> list[Row]:
    """Motions of a random state."""
    q, exact = bay.draw(rng), rng.random() >= WRONG
    nearest = int(bay.judge.gaps().argmin())
    outward = bay.judge.gradient(nearest)
    v = rng.choice(SPEEDS) * bay.top * rng.uniform(-1.0, 1.0, len(q))
    approaches = rng.random() < 0.5
    if approaches:
        # An operator on the way there: joints that bring the two together, as they do.
        v = -rng.choice(SPEEDS) * bay.top * outward / np.abs(outward).max()
    given = bay.ask(q, v) if exact else bay.ask_wrong(q, v, outward)
    if not given:
        return []
    bay.judge.place(q)
    given = given[:FEW]
    outwards = [bay.judge.gradient(t.pair) for t in given]
    rows = []
    for k, kind in enumerate(rng.choice(list(KINDS), MOTIONS, p=list(KINDS.values()))):
        # The nearest half of the time; else any of the nearest few.
        which = 0 if rng.random() < 0.5 else int(rng.integers(len(given)))
        pair, time, _ = given[which]
        motion = draw_motion(kind, q, v, outwards[which], bay, rng)
        followed = k % TO_THE_END == 0
        # Whether it was given too long is decided by then; how much too short is not.
        horizon = max(HORIZON, time) if followed else time
        true = bay.contact(motion, pair, horizon)
        close = approaches and pair == nearest
        rows.append(Row(exact, str(kind), close, followed, time, true))
    return rows


def close_figures(bay: Bay, rng: np.random.Generator) -> dict[str, Any]:
    """Figures of pairs that touch in a few cycles, at full speed."""
    rows: list[Row] = []
    while len(rows) < CLOSE:
        q = bay.draw(rng)
        nearest = int(bay.judge.gaps().argmin())
        goal = rng.uniform(*ABOUT)
        for _ in range(CLOSING):
            bay.judge.place(q)
            outward = bay.judge.gradient(nearest)
            way = (bay.judge.gap(nearest) - goal) / float(outward @ outward)
            q = q - way * outward
        if not ((bay.lower <= q) & (q <= bay.upper)).all():
            continue
        bay.judge.place(q)
        gaps = bay.judge.gaps()
        if int(gaps.argmin()) != nearest or not 0.0 < gaps.min() < 2.0 * ABOUT[1]:
            continue
        v = -bay.top * outward / np.abs(outward).max()
        exact = len(rows) % 2 == 0
        answers = bay.ask(q, v) if exact else bay.ask_wrong(q, v, outward)
        for given in answers:
            if given.pair == nearest:
                motion = draw_motion("towards", q, v, outward, bay, rng)
                true = bay.contact(motion, nearest, HORIZON)
                rows.append(Row(exact, "towards", True, True, given.time, true))
    exact = [row for row in rows if row.exact]
    return {"exact": summed_up(exact), **wrong_figures(rows, bay)}


def summed_up(rows: list[Row]) -> dict[str, Any]:
    """Figures of motions."""
    given = np.array([row.given for row in rows])
    true = np.array([row.true for row in rows])
    followed = np.array([row.followed for row in rows], dtype=bool)
    late = given > true
    touching = followed & np.isfinite(true)
    shares = given[touching & (true > 0.0)] / true[touching & (true > 0.0)]
    found = np.percentile(shares, (5, 50, 95)) if len(shares) else np.zeros(3)
    return {
        "motions": len(rows),
        "told_too_long": int(late.sum()),
        "longest_excess_ms": float(1e3 * (given - true)[late].max(initial=0.0)),
        "followed": int(followed.sum()),
        "touching": int(touching.sum()),
        "share_p5": float(found[0]),
        "share_median": float(found[1]),
        "share_p95": float(found[2]),
    }


def approach_figures(seed: int) -> dict[str, Any]:
    """Whether the time falls evenly on straight approaches at constant speed."""
    rng, bay = np.random.default_rng(seed), Bay()
    found = {}
    for way in ("tool", "joints"):
        say(f"{APPROACHES} approaches, straight for the {way}")
        rises: list[float] = []
        falls: list[float] = []
        cycles = 0
        while len(rises) < APPROACHES:
            times = approach(bay, way, rng)
            if len(times) < SHORTEST:
                continue
            steps = 1e3 * np.diff(times)
            cycles += len(times)
            rises.append(float(steps.max(initial=0.0)))
            falls.append(float(-steps.min(initial=0.0)))
        found[way] = {
            "approaches": APPROACHES,
            "cycles": cycles,
            "with_a_rise": sum(rise > 0.0 for rise in rises),
            "largest_rise_ms": max(rises),
            "largest_fall_ms": max(falls),
        }
    return found


def approach(bay: Bay, way: str, rng: np.random.Generator) -> Floats:
    """Times given for the last link and what it is led to, cycle by cycle [s].

    Args:
        bay: The bay.
        way: "tool": its tip on a straight line at constant speed; "joints": every joint
            at constant speed.
        rng: Of the approach.

    Returns:
        While the distance falls, up to `NEAREST`; empty if nothing is before it.
    """
    judge = bay.judge
    last = bay.guard.tables.moving_count - 1
    own = [k for k, (i, j) in enumerate(judge.pairs) if i == last and j > last]
    q = bay.draw(rng)
    gaps = [judge.gap(k) for k in own]
    pair = own[int(np.argmin(gaps))]
    if not 0.5 * FARTHEST < min(gaps) < FARTHEST:
        return np.zeros(0)
    outward = judge.gradient(pair)
    v = -outward * SPEED / float(outward @ outward)
    towards = judge.normal
    times: list[float] = []
    distance = np.inf
    bay.guard.reset()
    bay.now += 1.0
    while True:
        if way == "tool":
            judge.place(q)
            J = judge.point_jacobian(last, TIP)
            v = np.linalg.pinv(J, rcond=FLAT) @ (SPEED * towards)
        bay.now += PERIOD
        verdict = bay.guard.step(q, bay.now, velocity=v, now=bay.now)
        mine = [t for t in bay.estimates(verdict) if t.pair == pair]
        if not mine or not NEAREST < mine[0].distance < distance:
            return np.array(times)
        if (np.abs(v) > bay.top).any():
            return np.array(times)
        distance = mine[0].distance
        times.append(mine[0].time)
        q = q + PERIOD * v
