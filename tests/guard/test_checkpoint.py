"""A checkpoint: another guard goes on from it as if it had been there all the time.

What is restored into has another past each time, and what a checkpoint leaves out is
filled with NaN before: only what decides nothing may be left out.
"""

import numpy as np
import pytest

from armguard import Guard, bay_scene
from armguard.errors import ArmguardError, SceneError
from armguard.geometry import Box, Hull, Pose, Sphere
from armguard.guard.checkpoint import MAGIC, CheckpointError, unpack
from armguard.guard.levels import Level
from armguard.guard.watch import FEW
from armguard.scene.settings import IndexSettings, ResponseSettings
from bay_loop import LEFT, RIGHT, bay_guard
from grippers import PERIOD, Loop, guard_of, pick_scene
from respond.test_evade import cart_guard
from respond.test_gripping import DOWN, OPEN, UP, closed_on, fingers
from respond.test_gripping import crowd as crowd_of_fixtures

# What each ledger holds that is neither kept nor said by the scene.
SCRATCH = {
    "_watch": "look reserve row grown judged_left judged_stops judged_clock "
    "judged_settled",
    "_motion": "up down middle width spread axes node_q node_T node_axes node_way "
    "node_wide node_grow q_half q_node q_way q_wide q_grow box_axes sizes corner_T "
    "columns lever_rows hessian",
    "_response": "twists tool_columns tool_square tool_speeds raw rows limits eased "
    "program",
    "_lead": "pull push weight",
    "_escape": "plan trial q T rows boxes reach obstacle witness closest columns "
    "across",
    "_workspace": "T_next kept out look_box",
}


def spoil(guard):
    """Fill with NaN what a checkpoint leaves out."""
    for ledger, names in SCRATCH.items():
        arrays = getattr(guard, ledger, None)
        for name in names.split() if arrays is not None else ():
            array = getattr(arrays, name)
            fields = [array[field] for field in array.dtype.names or ()] or [array]
            for field in fields:
                if field.dtype.kind == "f":
                    field.fill(np.nan)


class Twins:
    """A guard, and another one that goes on from its checkpoints.

    Every call goes to both; their answers must be the same bits.
    """

    def __init__(self, make, rng):
        self.make = make
        self.first, self.second = make(), make()
        self.rng = rng
        self.together = False
        self.compared = 0
        self.levels = set()

    def fork(self):
        """Let another guard take over, which has a short past of its own."""
        data = self.first.checkpoint()
        self.second = self.make()
        self.stray(3)
        spoil(self.second)
        self.second.restore(data)
        assert self.second.checkpoint() == data
        self.together = True

    def do(self, call, *arguments, **named):
        """Call both; what they refuse they refuse alike."""
        answers = []
        for guard in (self.first, self.second)[: 1 + self.together]:
            try:
                answers.append(getattr(guard, call)(*arguments, **named))
            except ArmguardError as error:
                answers.append(str(error))
        if self.together:
            assert str(answers[0]) == str(answers[-1])
        return answers[0]

    def cycle(self, call, *arguments, **named):
        """A cycle of both."""
        answers = [
            getattr(guard, call)(*arguments, **named)
            for guard in (self.first, self.second)[: 1 + self.together]
        ]
        verdicts = [a if call == "step" else a.verdict for a in answers]
        self.levels.add(verdicts[0].level)
        if self.together:
            self.compared += 1
            assert verdicts[0].numbers.tobytes() == verdicts[1].numbers.tobytes()
            if call != "step":
                assert answers[0].numbers.tobytes() == answers[1].numbers.tobytes()
            assert (self.first.poses == self.second.poses).all()
        return answers[0]

    def stray(self, cycles):
        """Give the second one a past of its own."""
        guard, q = self.second, self.second.home
        filters = all(part.mode != "fixed" for part in guard.tables.robots)
        for k in range(cycles):
            q = q + self.rng.normal(size=len(q)) * 1e-4
            if filters:
                guard.filter(q, 0.1 * self.rng.normal(size=len(q)), k * PERIOD)
            else:
                guard.step(q, k * PERIOD)


def drive(twins, cycles, *, every, period, operator, filters=True, forms=("filter",)):
    """Drive the first guard's arms by its commands, forking now and then.

    Args:
        twins: The guards.
        cycles: How many cycles.
        every: Cycles between two checkpoints.
        period: Time of a cycle [s].
        operator: Called with the cycle and positions, gives desired velocities.
        filters: Whether commands go through the guard.
        forms: Calls that are drawn from.
    """
    rng, guard = twins.rng, twins.first
    n = len(guard.q_names)
    q, v = guard.home, np.zeros(n)
    forks = set(
        rng.integers(1, every, cycles // every) + every * np.arange(cycles // every)
    )
    for k in range(cycles):
        if k in forks:
            twins.fork()
        t = (k + 1) * period
        qm = q + rng.uniform(-1e-5, 1e-5, n)
        vm = v + rng.uniform(-1e-4, 1e-4, n)
        asked = operator(k, q)
        if k % 97 == 96:
            # An input that no guard can use, among all the others.
            qm[int(rng.integers(n))] = np.nan
        if not filters:
            twins.cycle("step", qm, t, velocity=vm)
            v = asked
        else:
            form = forms[int(rng.integers(len(forms)))]
            if form == "filter_twists":
                name = guard.tables.robots[0].name
                asked = {name: rng.normal(size=6) * 0.1}
            elif form == "filter_positions":
                asked = q + asked * 0.05
            command = twins.cycle(form, qm, asked, t - 2e-4, velocity=vm, now=t)
            v = command.velocity
        q = q + v * period
        if k % 150 == 149:
            twins.do("engage")


def towards(rng, guard, reach=1.2, speed=1.0):
    """Goals drawn round home, each for a while."""
    goal = guard.home

    def operator(k, q):
        nonlocal goal
        if k % 120 == 0:
            goal = guard.home + rng.uniform(-reach, reach, len(q))
        return np.clip(3.0 * (goal - q), -speed, speed)

    return operator


@pytest.mark.parametrize("response", ["deflect", "stop", "slow", "field"])
def test_the_bay_with_each_response(response):
    rng = np.random.default_rng(len(response))
    twins = Twins(lambda: bay_guard(kind=response), rng)
    if response == "field":
        for name, own in (("left", LEFT), ("right", RIGHT)):
            goal = twins.first.home[own] + rng.uniform(-0.5, 0.5, 7)
            twins.do("field_goal", name, q=goal)
    calls = ("filter", "filter", "filter_positions", "filter_twists")
    operator = towards(rng, twins.first)
    drive(twins, 900, every=180, period=0.001, operator=operator, forms=calls)
    assert twins.compared > 500
    assert max(twins.levels) > Level.CLEAR


def test_a_stop_a_retreat_and_a_ball_that_comes_and_goes():
    rng = np.random.default_rng(3)
    twins = Twins(lambda: bay_guard(kind="stop"), rng)
    operator = towards(rng, twins.first, reach=2.0)

    def with_calls(k, q):
        if k % 170 == 60:
            # Far outside of the cube as well, which then grows for good.
            far = 9.0 if k < 200 else 0.5
            twins.do("place", "cart", Pose(xyz=(far, rng.uniform(-1, 1), 1.2)))
        if k % 170 == 130:
            twins.do("remove", "cart")
        if k % 200 == 150:
            twins.do("retreat", "left")
        if k == 700:
            twins.do("reset")
        return operator(k, q)

    drive(twins, 1000, every=90, period=0.001, operator=with_calls)
    assert Level.STOP in twins.levels
    assert twins.compared > 600


@pytest.mark.parametrize("mode", ["fixed", "speed"])
def test_modes_without_commands(mode):
    rng = np.random.default_rng(5)
    twins = Twins(lambda: Guard(bay_scene(mode), self_test=False), rng)
    operator = towards(rng, twins.first, speed=0.5)
    drive(twins, 400, every=70, period=0.001, operator=operator, filters=False)
    assert twins.compared > 250


def crowd():
    """An arm among so many objects that the index is asked, some of them hulls."""
    rng = np.random.default_rng(8)
    bare = bay_scene("path")
    for k in range(FEW):
        place = (*rng.uniform(-1.5, 1.5, 2), rng.uniform(0.0, 0.1))
        shape = Sphere(radius=0.02)
        if k % 10 == 0:
            shape = Hull(points=rng.uniform(-0.03, 0.03, (8, 3)))
        bare.add(shape, name=f"thing{k}", pose=Pose(xyz=place))
    return Guard(bare, self_test=False)


def test_a_scene_in_which_the_index_is_asked():
    rng = np.random.default_rng(9)
    twins = Twins(crowd, rng)
    operator = towards(rng, twins.first, reach=2.0)

    def with_calls(k, q):
        if k % 40 == 20:
            place = (*rng.uniform(-1.0, 1.0, 2), rng.uniform(0.1, 0.9))
            name = f"thing{10 * (k // 40 % 15)}"
            twins.do("place", name, Pose(xyz=place, rpy=rng.uniform(-1, 1, 3)))
        return operator(k, q)

    drive(twins, 400, every=80, period=0.001, operator=with_calls)
    assert twins.compared > 250
    twins.first.index.check()
    twins.second.index.check()


def test_what_comes_and_is_evaded():
    rng = np.random.default_rng(2)
    twins = Twins(cart_guard, rng)
    q, v = np.zeros(1), np.zeros(1)
    evaded = 0
    for k in range(1500):
        t = k * 0.001
        y = 0.6 - 0.3 * t
        where = Pose(xyz=(0.7, y, 0.2))
        twins.do("place", "cart", where, t, velocity=(0.0, -0.3, 0.0))
        if k % 170 == 160:
            twins.fork()
        command = twins.cycle("filter", q, np.zeros(1), t, velocity=v, now=t)
        evaded += abs(command.velocity[0]) > 0.0
        v = command.velocity
        q = q + v * 0.001
    assert evaded > 100
    assert twins.compared > 1000


class Forked:
    """Twins as one guard, forking by itself, for a loop that knows nothing of it."""

    def __init__(self, twins, every):
        self.twins, self.every, self.count = twins, every, 0

    def __getattr__(self, name):
        if name in ("grasp", "release", "allow", "swap_model", "engage", "place"):
            return lambda *a, **named: self.twins.do(name, *a, **named)
        return getattr(self.twins.first, name)

    def filter(self, *arguments, **named):
        self.count += 1
        if self.count % self.every == 0:
            self.twins.fork()
        return self.twins.cycle("filter", *arguments, **named)


@pytest.mark.parametrize(
    ("kind", "count"),
    [("octree", 0), ("octree", FEW), ("joint_table", 0), ("brute_force", 0)],
)
def test_a_block_is_gripped_carried_and_put_down(kind, count):
    def make():
        index = IndexSettings(kind=kind)
        return guard_of(crowd_of_fixtures(pick_scene(index=index), count))

    twins = Twins(make, np.random.default_rng(4))
    guard = Forked(twins, 173)
    loop = Loop(guard)
    assert loop.go({"arm/z": UP}, speed=0.3)
    closed_on(loop)
    assert guard.held == {"block": ("arm",)}
    twins.fork()
    assert twins.second.held == guard.held
    assert twins.second.contracts == guard.contracts
    assert loop.go({"arm/z": UP})
    assert loop.go({"arm/x": 0.1})
    twins.do("swap_model", "arm", "detailed")
    assert loop.go({"arm/z": DOWN}, speed=0.08)
    twins.do("release", "arm", "block")
    assert guard.held == {}
    assert loop.go(fingers(OPEN), speed=0.05)
    assert loop.go({"arm/z": UP})
    assert twins.compared > 3000


def test_what_stood_elsewhere_in_the_past_of_another_guard_is_put_back():
    def make():
        return bay_guard()

    a, b = make(), make()
    b.place("cart", Pose(xyz=(0.0, 0.0, 1.0)))
    b.restore(a.checkpoint())
    q = a.home
    for k in range(3):
        answers = [g.filter(q, 0.0 * q, k * 1e-3, velocity=0.0 * q) for g in (a, b)]
        assert answers[0].numbers.tobytes() == answers[1].numbers.tobytes()
        numbers = [c.verdict.numbers.tobytes() for c in answers]
        assert numbers[0] == numbers[1]


def test_what_is_no_checkpoint_of_this_scene_is_refused_and_changes_nothing():
    guard = bay_guard()
    data = guard.checkpoint()
    for wrong in (b"", b"nothing", data[:-8], data[:40], data + bytes(8)):
        with pytest.raises(CheckpointError):
            guard.restore(wrong)
    assert guard.checkpoint() == data
    scene = bay_scene("path")
    scene.add(Box(size=(0.2, 0.2, 0.2)), name="more", pose=Pose(xyz=(2, 2, 0)))
    other = Guard(scene, self_test=False)
    with pytest.raises(CheckpointError, match="another scene"):
        other.restore(data)


def gripping_guard():
    """A guard of all that a checkpoint can be about, and its checkpoint."""
    scene = pick_scene()
    corners = 0.03 * np.array([*np.ndindex(2, 2, 2)], dtype=float)
    scene.add(Hull(points=corners), name="stone", pose=Pose(xyz=(0.5, 0.5, 0.2)))
    guard = guard_of(scene)
    guard.filter(guard.home, 0.0 * guard.home, 0.0, velocity=0.0 * guard.home)
    guard.place("stone", Pose(xyz=(0.5, 0.4, 0.3)))
    return guard


def places_of(guard, data):
    """Where each array of a checkpoint begins, by name."""
    _, _, numbers = unpack(data)
    at, found = len(data) - len(numbers), {}
    for name, array in guard._saving.arrays.items():
        found[name] = at
        at += array.nbytes
    return {**found, "rows": at}


def test_every_whole_number_of_a_checkpoint_has_a_rule():
    guard = gripping_guard()
    rules, greatest = guard._saving.rules, guard._saving.greatest
    for name, array in guard._saving.arrays.items():
        if array.dtype.kind == "f":
            continue
        fields = array.dtype.fields or {}
        whole = {field for field, (kind, _) in fields.items() if kind.base.kind != "f"}
        all_of_them = whole if fields else set(range(array.shape[-1]))
        columns = set()
        for rule in rules.get(name, ()):
            columns |= all_of_them if rule.columns is None else set(rule.columns)
        assert columns >= all_of_them, name
    assert set(rules) <= set(guard._saving.arrays)
    for rule in (rule for some in rules.values() for rule in some):
        assert not isinstance(getattr(rule, "most", 0), str) or rule.most in greatest


@pytest.mark.parametrize("value", [1 << 41, 1 << 62, -7000, -(1 << 63)])
def test_a_number_that_is_no_place_is_refused_in_every_field(value):
    guard = gripping_guard()
    good = guard.checkpoint()
    rules = guard._saving.rules
    starts = places_of(guard, good)
    refused = 0
    for name, array in guard._saving.arrays.items():
        if name not in rules or not array.size or array.dtype.kind == "u":
            continue
        columns = {c for rule in rules[name] for c in rule.columns or [0]}
        for column in columns:
            data = bytearray(good)
            kind, offset = (array.dtype.fields or {}).get(column, (array.dtype, None))
            place = column * kind.itemsize if offset is None else offset
            at = starts[name] + place
            if kind.itemsize == 4 and not abs(value) < 1 << 31:
                continue
            data[at : at + kind.itemsize] = np.array([value], dtype=kind).tobytes()
            with pytest.raises(CheckpointError, match=name):
                guard.restore(bytes(data))
            refused += 1
    assert refused > 15
    assert guard.checkpoint() == good


def test_a_size_or_a_place_that_nothing_has_is_refused():
    guard = gripping_guard()
    good = guard.checkpoint()
    starts = places_of(guard, good)
    moving = guard.tables.moving_count
    stone = starts["rows"] + 8 * 16 * moving
    for at, value in (
        (starts["rows"], 5.0),  # a radius of the arm
        (starts["rows"] + 8, 1.0),  # where it is
        (stone, -0.1),
        (stone + 8, np.inf),
        (stone + 8 * 5, 1e6),  # how many corners it has
        (stone + 8 * 7, 3.0),
        (starts["workspace.T_world"], np.nan),
        (starts["tables.T_parent_joint"], 2.0),
    ):
        data = bytearray(good)
        data[at : at + 8] = np.array([value]).tobytes()
        with pytest.raises(CheckpointError):
            guard.restore(bytes(data))
    assert guard.checkpoint() == good


@pytest.mark.parametrize(
    "text",
    [
        b"[]",
        b"null",
        b"[" * 100_000,
        b'{"last_stamp": "0", "changed": [], "holders": {}}',
        b'{"last_stamp": 0.0, "changed": ["nothing"], "holders": {}}',
        b'{"last_stamp": 0.0, "changed": ["stone", "stone"], "holders": {}}',
        b'{"last_stamp": 0.0, "changed": [["stone"]], "holders": {}}',
        b'{"last_stamp": 0.0, "changed": ["stone"], "holders": {"stone": ["arm"]}}',
        b'{"last_stamp": 0.0, "changed": ["stone"], "holders": {"block": ["arm"]}}',
        b'{"last_stamp": 0.0, "changed": ["stone"], "holders": {"block": []}}',
    ],
)
def test_words_of_a_checkpoint_that_are_not_of_the_scene_are_refused(text):
    guard = gripping_guard()
    good = guard.checkpoint()
    layout, _, numbers = unpack(good)
    text += b" " * (-len(text) % 8)
    size = len(text).to_bytes(8, "little")
    with pytest.raises(CheckpointError):
        guard.restore(MAGIC + layout + size + text + numbers)
    assert guard.checkpoint() == good


def test_a_guard_that_evades_has_its_settings_from_its_own_scene():
    # Settings are the scene's: a checkpoint of one response goes on under another one.
    a, b = bay_guard(kind="stop"), bay_guard(kind="slow")
    b.restore(a.checkpoint())
    assert b.tables.robots[0].response == ResponseSettings(kind="slow")
    with pytest.raises(SceneError):
        b.place("cart", Pose(xyz=(0, 0, 1)), velocity=(1.0, 0.0, 0.0))
