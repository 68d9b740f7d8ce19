"""OMPL with the checker beside OMPL with Coal: times, success, contacts of the plans.

    python benchmarks/batch_planning.py [panda_59_spheres.json] [--json]

Both plan with RRT-Connect among the same primitives, with the same seeds and limits of
time. The checker proves each motion; Pinocchio with Coal tests samples of it, a share
of the extent of the joint box apart. Each plan is then judged between its rows, at
steps so small that nothing moves farther than two millimetres.
"""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from time import thread_time
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import yaml
from numpy.typing import NDArray
from ompl import base, geometric, util

import armguard as ag
from armguard.scene import SceneTables, load_scene
from armguard.scene.compile import compile_scene
from batch_rates import ring_scene, robots_of
from episodes.campaign import command
from peers.pinocchio_coal import AllDistances, BroadPhase
from timing import Progress, quiet

Floats = NDArray[np.float64]

# The public planning scenes, beside the project.
PUBLIC = Path(__file__).parents[1].parent / "shared" / "motionbench"
FOLDERS = (
    "bookshelf_small_panda",
    "table_pick_panda",
    "bookshelf_tall_both_arms_easy_baxter",
)
PROBLEMS = 10

# Plans of each problem, and the processor time a planner may take [s].
SEEDS = 2
LIMIT = 1.0

# Distance of the samples of a motion, as a share of the joint box's extent: OMPL's
# default, and a tenth of it.
SAMPLINGS = {"Coal, samples 1 % apart": 0.01, "Coal, samples 0.1 % apart": 0.001}
OURS = "armguard, proven"

# Queries among 14 balls and 21 boxes.
QUERIES = 20

# Farthest that a point moves between two looks of the judge, the longest arm that is
# assumed for that, and the depth from which on an overlap counts [m].
STEP = 2e-3
ARM = 1.2
DEPTH = 1e-5


class Problem(NamedTuple):
    """A scene, and where to plan from and to.

    Attributes:
        name: Name of the problem.
        tables: The scene; every buffer is 0.
        start: Joint positions at the start, shape (n,) [rad or m].
        goal: Joint positions at the goal, of that shape.
        planned: Places of the joints that may move.
    """

    name: str
    tables: SceneTables
    start: Floats
    goal: Floats
    planned: NDArray[np.intp]


class Contestant(NamedTuple):
    """The answers by which a planner passes or not.

    Attributes:
        valid: Whether a configuration is clear.
        motion: Whether a motion is; None where samples are tested.
        resolution: Distance of these samples, a share of the joint box's extent.
    """

    valid: Callable[[Floats], bool]
    motion: Callable[[Floats, Floats], bool] | None
    resolution: float


def public_problem(folder: str, number: int) -> Problem:
    """A problem of the public data set."""
    scene = load_scene(PUBLIC / folder / f"scene{number:04}.yaml")
    scene.buffer = 0.0
    text = (PUBLIC / folder / f"request{number:04}.yaml").read_text(encoding="utf-8")
    request = yaml.safe_load(text)
    state = request["start_state"]["joint_state"]
    begin = dict(zip(state["name"], state["position"], strict=True))
    end = {
        joint["joint_name"]: joint["position"]
        for goal in request["goal_constraints"]
        for joint in goal["joint_constraints"]
    }
    names = [name.split("/")[1] for name in scene.q_names]
    home = dict(zip(names, scene.home.tolist(), strict=True))
    start = np.array([begin.get(name, home[name]) for name in names])
    goal = np.array([end.get(name, q) for name, q in zip(names, start, strict=True)])
    planned = np.array([names.index(name) for name in end])
    name = f"{folder} {number}"
    return Problem(name, primitives_of(scene), start, goal, np.sort(planned))


def primitives_of(scene: ag.Scene) -> SceneTables:
    """Tables of a scene without the exact shapes of links, which Coal does not get."""
    tables = compile_scene(scene)
    none = np.tile(np.array([-1, 0], dtype=np.int32), (len(tables.kinds), 1))
    return replace(tables, exact=replace(tables.exact, of_primitive=none))


def queries(scene: ag.Scene, count: int) -> Iterator[Problem]:
    """Clear random configurations of a scene as starts and goals."""
    tables = primitives_of(scene)
    checker, rng = ag.Checker(tables), np.random.default_rng(4)
    size = (100 * count, len(tables.lower))
    q = rng.uniform(tables.lower, tables.upper, size)
    q = q[checker.clear(q)][: 2 * count]
    for k in range(count):
        start, goal = q[2 * k : 2 * k + 2]
        yield Problem(f"query {k}", tables, start, goal, np.arange(size[1]))


class Coal:
    """Pinocchio and Coal on a scene's primitives.

    Args:
        tables: The scene.
    """

    def __init__(self, tables: SceneTables) -> None:
        exact = replace(tables, margin=0.0)
        self._any, self._all = BroadPhase(exact), AllDistances(exact)
        geometry, results = self._any.geometry, self._any.results
        self._any.callback = pin.CollisionCallBackDefault(geometry, results, True)

    def touches(self, q: Floats) -> bool:
        """Whether any pair is in contact in a configuration, shape (n,)."""
        return bool(self._any.step(self._any.positions(q[None])[0]))

    def depth(self, q: Floats) -> float:
        """Depth of the deepest overlap in a configuration [m]; negative for none."""
        self._all.step(self._all.positions(q[None])[0])
        return -min(r.min_distance for r in self._all.results.distanceResults)

    def deepest(self, plan: Floats) -> float:
        """Deepest overlap on a plan, shape (k, n), and between its rows; 0 for none."""
        found = 0.0
        for start, end in pairwise(plan):
            count = int(np.ceil(ARM * np.abs(end - start).sum() / STEP)) + 1
            rows = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
            for q, own in zip(rows, self._any.positions(rows), strict=True):
                if self._any.step(own):
                    found = max(found, self.depth(q))
        return found


def contestants(tables: SceneTables, coal: Coal) -> dict[str, Contestant]:
    """The checker, and Coal with each distance of samples."""
    checker = ag.Checker(tables)

    def clear(q: Floats) -> bool:
        return bool(checker.clear(q[None])[0])

    def proven(a: Floats, b: Floats) -> bool:
        return bool(checker.prove(a[None], b[None]).proven[0])

    def sampled(q: Floats) -> bool:
        return not coal.touches(q)

    # The first calls load what is compiled.
    clear(tables.home)
    proven(tables.home, tables.home)
    found = {OURS: Contestant(clear, proven, 0.01)}
    return found | {
        name: Contestant(sampled, None, share) for name, share in SAMPLINGS.items()
    }


def row(state: base.State, problem: Problem) -> Floats:
    """Joint positions of a state: those that are not planned stay at the start."""
    q = problem.start.copy()
    q[problem.planned] = [state[k] for k in range(len(problem.planned))]
    return q


class ValidStates(base.StateValidityChecker):
    """A contestant's answer for states."""

    def __init__(
        self, space: base.SpaceInformation, one: Contestant, problem: Problem
    ) -> None:
        super().__init__(space)
        self.one, self.problem = one, problem

    def isValid(self, state: base.State) -> bool:
        """Whether a state is clear."""
        return self.one.valid(row(state, self.problem))


class ValidMotions(base.MotionValidator):
    """A contestant's answer for motions."""

    def __init__(
        self, space: base.SpaceInformation, one: Contestant, problem: Problem
    ) -> None:
        super().__init__(space)
        self.one, self.problem = one, problem

    def checkMotion(self, start: base.State, end: base.State) -> bool:
        """Whether a motion is clear."""
        assert self.one.motion is not None
        return self.one.motion(row(start, self.problem), row(end, self.problem))


def planned(
    problem: Problem, one: Contestant, seed: int, limit: float
) -> tuple[float, Floats | None]:
    """Processor time of planning [s], and the plan, shape (k, n); None without one."""
    util.RNG.setSeed(seed)
    places = problem.planned
    space = base.RealVectorStateSpace(len(places))
    bounds = base.RealVectorBounds(len(places))
    for k, place in enumerate(places.tolist()):
        bounds.setLow(k, problem.tables.lower[place])
        bounds.setHigh(k, problem.tables.upper[place])
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(ValidStates(information, one, problem))
    if one.motion is not None:
        information.setMotionValidator(ValidMotions(information, one, problem))
    information.setStateValidityCheckingResolution(one.resolution)
    setup.setPlanner(geometric.RRTConnect(information))
    ends = [space.allocState(), space.allocState()]
    for state, q in zip(ends, (problem.start, problem.goal), strict=True):
        for k, place in enumerate(places.tolist()):
            state[k] = q[place]
    setup.setStartAndGoalStates(*ends)
    setup.setup()
    begin = thread_time()
    over = base.PlannerTerminationCondition(lambda: thread_time() > begin + limit)
    solved = setup.solve(over)
    took = thread_time() - begin
    if not solved or not setup.haveExactSolutionPath():
        return took, None
    states = setup.getSolutionPath().getStates()
    return took, np.array([row(state, problem) for state in states])


def figures_of(runs: list[tuple[float, float | None]]) -> dict[str, Any]:
    """Figures of some plans: processor time of each [s], and its deepest overlap."""
    depths = [depth for _, depth in runs if depth is not None]
    times = 1e3 * np.array([took for took, depth in runs if depth is not None])
    touching = [depth for depth in depths if depth > DEPTH]
    return {
        "runs": len(runs),
        "solved": len(depths),
        "median_ms": float(np.median(times)) if len(times) else None,
        "p90_ms": float(np.percentile(times, 90.0)) if len(times) else None,
        "touching": len(touching),
        "deepest_mm": 1e3 * max(touching, default=0.0),
    }


def plan_all(
    problems: Iterator[Problem],
    seeds: int,
    limit: float,
    progress: Progress,
) -> tuple[dict[str, Any], list[str]]:
    """Figures by contestant, and problems whose ends the primitives do not permit."""
    runs: dict[str, list[tuple[float, float | None]]] = {}
    left_out, scene = [], None
    for problem in problems:
        if scene is not problem.tables:
            scene, coal = problem.tables, Coal(problem.tables)
            found = contestants(scene, coal)
        if not all(map(found[OURS].valid, (problem.start, problem.goal))):
            left_out.append(problem.name)
            continue
        plans = []
        with quiet():
            for seed in range(1, seeds + 1):
                for name, one in found.items():
                    plans.append((name, *planned(problem, one, seed, limit)))
        progress(f"{problem.name}: judging {len(plans)} plans")
        for name, took, plan in plans:
            depth = None if plan is None else coal.deepest(plan)
            runs.setdefault(name, []).append((took, depth))
    return {name: figures_of(own) for name, own in runs.items()}, left_out


def measure(
    files: list[str],
    seeds: int = SEEDS,
    limit: float = LIMIT,
    progress: Progress = print,
) -> dict[str, Any]:
    """Figures of the public problems, by robot, and of queries among 35 items."""
    util.setLogLevel(util.LogLevel.LOG_NONE)
    rows, left_out = {}, []
    for folder in FOLDERS if PUBLIC.is_dir() else ():
        problems = (public_problem(folder, k + 1) for k in range(PROBLEMS))
        rows[folder], out = plan_all(problems, seeds, limit, progress)
        left_out += out
    for name, robot in robots_of(files).items():
        scene = ring_scene(robot, 14, 21)
        rows[f"14 balls, 21 boxes, {name}"], out = plan_all(
            queries(scene, QUERIES), seeds, limit, progress
        )
    return {"rows": rows, "left out": left_out, "seeds": seeds, "limit_s": limit}


def main() -> None:
    """Print the figures."""
    parser = command(__doc__)
    parser.add_argument("files", nargs="*", metavar="FILE", help="robots of spheres")
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    found = measure(chosen.files)
    if chosen.json:
        print(json.dumps(found, indent=1))
        return
    print("left out:", ", ".join(found["left out"]))
    for scene, kinds in found["rows"].items():
        print(scene)
        for name, figures in kinds.items():
            print(f"  {name}:", ", ".join(f"{k} {v}" for k, v in figures.items()))


if __name__ == "__main__":
    main()
