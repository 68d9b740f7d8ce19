"""Three robots and more: no circle of waits, apart by Coal, all jobs end."""

from itertools import combinations

import numpy as np
import pytest

import armguard as ag
from armguard.geometry import Capsule, Pose
from armguard.maps.line_cell import Job, LineCell, LinePlan
from armguard.maps.online import Line
from armguard.maps.right_of_way import STEP, Order, RightOfWay
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from crossing import cell_of, headroom, plan_through
from verifying.plans import World

CYCLE = 0.01

# Side of the triangle on whose sides pistons move, and how far before it they rest [m].
SIDE, BEFORE = 0.6, 0.3


def random_gates(rng, count, length, most=2):
    """Gates of every two robots, at most so many of each, by node and by cells."""
    orders = {}
    for pair in combinations(range(count), 2):
        gates = []
        for _ in pair:
            size = rng.integers(0, most + 1)
            at = np.sort(rng.choice(length, size, replace=False))
            cells = np.sort(rng.choice(np.arange(1, length + 1), size, replace=False))
            gates.append(tuple(zip(at.tolist(), cells.tolist(), strict=True)))
        orders[pair] = Order((gates[0], gates[1]), tight=False)
    return orders


def may_go(orders, places, k):
    """Whether all gates let a robot leave its node."""
    for pair, order in orders.items():
        if k in pair:
            side = pair.index(k)
            other = places[pair[1 - side]]
            if any(at <= places[k] and other < n for at, n in order.gates[side]):
                return False
    return True


def deadlocks(orders, count, length):
    """Whether any paces lead to where no robot can go on; all paces are searched."""
    seen, todo = set(), [(0,) * count]
    while todo:
        places = todo.pop()
        if places in seen:
            continue
        seen.add(places)
        going = [k for k in range(count) if places[k] < length]
        free = [k for k in going if may_go(orders, places, k)]
        if going and not free:
            return True
        todo += [tuple(at + (j == k) for j, at in enumerate(places)) for k in free]
    return False


@pytest.mark.parametrize(("count", "length", "most"), [(3, 5, 2), (4, 4, 1)])
def test_a_circle_is_found_if_and_only_if_some_paces_lead_into_one(count, length, most):
    rng, found = np.random.default_rng(7), []
    for _ in range(120):
        orders = random_gates(rng, count, length, most)
        right = RightOfWay(orders, count)
        ends = right.passages([0] * count, [(0, 0, 0)] * count)
        found.append(ends is None)
        assert found[-1] == deadlocks(orders, count, length)
    assert 20 < sum(found) < 100


def stepwise(orders, nodes, holds, length):
    """Steps after which each robot is at each of its nodes, one step after another."""
    places, rests = list(nodes), [hold[2] for hold in holds]
    at = [{node: 0} for node in nodes]
    for t in range(400):
        free = []
        for k, (late, node, _) in enumerate(holds):
            if places[k] == length or t < late or not may_go(orders, places, k):
                continue
            if places[k] == node and rests[k]:
                rests[k] -= 1
            else:
                free.append(k)
        for k in free:
            places[k] += 1
            at[k][places[k]] = t + 1
    return at


def test_robots_pass_their_nodes_when_they_do_step_by_step():
    rng, compared, length = np.random.default_rng(8), 0, 12
    for _ in range(200):
        orders = random_gates(rng, 3, length)
        nodes = rng.integers(0, 5, 3).tolist()
        holds = [
            (int(rng.integers(0, 4)), int(rng.integers(n, length)), int(rest))
            for n, rest in zip(nodes, rng.integers(0, 4, 3), strict=True)
        ]
        found = RightOfWay(orders, 3).passages(nodes, holds)
        known = stepwise(orders, nodes, holds, length)
        assert (found is None) == any(length not in one for one in known)
        if found is not None:
            compared += 1
            for passage, steps in zip(found, known, strict=True):
                assert steps == {node: passage.arrives(node) for node in steps}
    assert compared > 50


def piston():
    """A rod that moves along x; its end is at 0 at rest."""
    rod = Capsule(start=(-1.6, 0.0, 0.0), end=(0.0, 0.0, 0.0), radius=0.03)
    shape = CollisionElement(geometry=rod, T_link_geometry=np.eye(4))
    link = Link(name="rod", collisions=(shape,))
    joint = Joint(
        name="slide",
        kind=JointKind.PRISMATIC,
        parent="base",
        child="rod",
        T_parent_joint=np.eye(4),
        axis=np.array([1.0, 0.0, 0.0]),
        lower=0.0,
        upper=2.0,
    )
    links = {"base": Link(name="base"), "rod": link}
    return RobotModel(
        name="piston", path=None, links=links, joints={"slide": joint}, root="base"
    )


@pytest.fixture(scope="module")
def pistons():
    """Three rods along the sides of a triangle, which meet at its corners.

    Each comes to one corner before the rod of the side before, goes on to the next
    corner, and only then back: if all set out together each holds what another needs.
    """
    scene = ag.Scene(mode="fixed", buffer=0.01)
    names = ("a", "b", "c")
    for k, name in enumerate(names):
        turn = 2.0 * np.pi * k / 3.0
        along = np.array([np.cos(turn), np.sin(turn)])
        middle = SIDE / np.sqrt(12.0) * np.array([along[1], -along[0]])
        x, y = middle - (0.5 * SIDE + BEFORE) * along
        base = Pose(xyz=(float(x), float(y), 0.0), rpy=(0.0, 0.0, turn))
        scene.add_robot(piston(), name=name, base=base)
    plans = {}
    for name in names:
        rows = np.array([[0.0], [BEFORE + SIDE + 0.2], [0.0]])
        motion = ag.Trajectory(
            (f"{name}/slide",), rows, np.array([0.0, 3.0, 6.0]), name
        )
        plan = ag.Plan.of(motion, scene, hold_home=True)
        plans[name] = LinePlan(name, ag.CellPlan(plan))
    return World.of(scene), LineCell.of(scene, plans)


class EachPair(Line):
    """Robots that look at orders of two alone."""

    def __init__(self, cell):
        super().__init__(cell)
        self._lanes.cost = lambda right: 0.0


def together(line, names, seconds=60.0):
    """Let each robot do a job that has arrived at once; rows and when that is done."""
    for k, name in enumerate(names):
        line.add(Job(k, (name,)))
    rows = []
    for k in range(int(seconds / CYCLE)):
        moves = line.step(CYCLE * k)
        rows.append(line.motion()[0])
        if not moves:
            return np.array(rows), CYCLE * k
    return np.array(rows), np.inf


def test_orders_that_close_a_circle_of_three_are_refused_and_another_way_is_found(
    pistons,
):
    world, cell = pistons
    line = EachPair(cell)
    rows, ends = together(line, cell.robots)
    # They wait for each other for ever.
    assert ends == np.inf and line.finished == {}
    assert all(lane.job and lane.yields_to for lane in line.lanes)
    assert (rows[-1] == rows[-1000]).all()
    line = Line(cell)
    rows, ends = together(line, cell.robots)
    assert sorted(line.finished) == [0, 1, 2]
    # Quicker than one after the other.
    assert ends < 15.0
    assert headroom(world, rows[::4]).min() >= -1e-7


def test_the_robot_that_would_close_a_circle_begins_at_once_behind_all_others(pistons):
    _, cell = pistons
    line = Line(cell)
    for k, name in enumerate(cell.robots):
        line.add(Job(k, (name,)))
    for k in range(10):
        line.step(CYCLE * k)
    assert all(lane.job for lane in line.lanes)
    last = cell.robots.index(line.events[2].split()[0])
    for other in {0, 1, 2} - {last}:
        first, second = sorted((last, other))
        gates = line.right_of_way.orders[first, second].gates
        assert gates[int(last > other)] and not gates[int(last < other)]


@pytest.fixture(scope="module")
def three():
    """Three arms that swing into the space of both others."""
    world = World.of(cell_of(("left", "right", "third")))
    ways = {
        "left": ([0.7, -0.6, -0.6, 0.7], [0.7, -0.6, 0.7, -0.6, 0.7]),
        "right": ([-0.7, 0.6, 0.6, -0.7], [-0.7, 0.6, -0.7, 0.6, -0.7]),
        "third": ([-1.7, 0.0, 0.0, -1.7], [-1.7, 0.5, -0.5, -1.7]),
    }
    # At both ends they rest for a second: with room to slow down before they meet.
    plans = {
        f"{robot} {k}": LinePlan(
            robot, plan_through(world.scene, robot, [way[0], *way, way[-1]])
        )
        for robot, both in ways.items()
        for k, way in enumerate(both)
    }
    return world, LineCell.of(world.scene, plans)


def test_each_two_of_three_arms_meet(three):
    _, cell = three
    for pair in combinations(cell.robots, 2):
        met = [
            crossing.blocked.any()
            for names, crossing in cell.crossings.items()
            if tuple(name.split()[0] for name in names) == pair
        ]
        assert len(met) == 4 and all(met)


@pytest.mark.parametrize("seed", range(3))
def test_three_arms_stay_apart_and_of_two_one_yields_and_all_jobs_end(three, seed):
    world, cell = three
    line, rng = Line(cell), np.random.default_rng(seed)
    names = [*rng.permutation([*cell.plans]), *rng.permutation([*cell.plans])]
    times = np.sort(rng.uniform(0.0, 12.0, len(names))).tolist()
    rows, yields = [], set()
    for k in range(12000):
        now = CYCLE * k
        while times and times[0] <= now:
            times.pop(0)
            line.add(Job(len(times), (names[len(times)],)))
        moves = line.step(now)
        rows.append(line.motion()[0])
        to = {(lane.robot, lane.yields_to) for lane in line.lanes if lane.yields_to}
        assert not any(pair[::-1] in to for pair in to)
        yields |= to
        if not moves and not times:
            break
    assert sorted(line.finished) == list(range(12))
    assert len(yields) >= 4
    assert headroom(world, np.array(rows)[::4]).min() >= -1e-7


def blocked(line, places):
    """Whether two robots are in a cell that is not free."""
    for a, b in combinations(range(len(line.lanes)), 2):
        crossing = line.cell.crossings[line.lanes[a].plan, line.lanes[b].plan]
        if crossing.blocked[int(places[a] / STEP), int(places[b] / STEP)]:
            return True
    return False


@pytest.mark.parametrize("seed", range(5))
def test_no_paces_of_three_arms_lead_into_blocked_cells_or_a_deadlock(three, seed):
    _, cell = three
    rng = np.random.default_rng(seed)
    line = Line(cell)
    for k, robot in enumerate(rng.permutation(cell.robots)):
        line.add(Job(k, (f"{robot} {rng.integers(2)}",)))
    for k in range(200):
        line.step(CYCLE * k)
        if all(lane.job for lane in line.lanes):
            break
    else:
        pytest.fail(f"{[lane.job for lane in line.lanes]} begin")
    ends = np.array([cell.plans[lane.plan].plan.plan.duration for lane in line.lanes])
    for _ in range(40):
        places = [lane.place for lane in line.lanes]
        # One of the robots may take long in each of its cells.
        slow = rng.uniform(0.02, 1.0, 3)
        while places != ends.tolist():
            limits = [line.right_of_way.limit(k, places)[0] for k in range(3)]
            free = [k for k in range(3) if places[k] < min(limits[k], ends[k]) - 1e-9]
            assert free, f"nobody can go on at {places}"
            k = rng.choice(free)
            step = slow[k] * rng.uniform(0.0, 0.3)
            if min(limits[k], ends[k]) - places[k] < 0.02:
                step = 0.3
            places[k] = min(places[k] + step, limits[k], ends[k])
            assert not blocked(line, np.minimum(places, ends - 1e-6).tolist())
