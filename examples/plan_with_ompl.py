"""Plan with OMPL over motions that armguard proves: a Panda reaches around a post.

Run it with `pip install 'armguard[robots,ompl]'` and `python plan_with_ompl.py`.
"""

import numpy as np
from ompl import base, geometric

import armguard as ag


def panda_among_boxes() -> ag.Scene:
    """A Panda at a table, with a post in front of it and a shelf beside it."""
    scene = ag.Scene(mode="fixed", buffer=0.01)
    scene.add_robot("panda", name="arm")
    for name, size, xyz in (
        ("table", (1.2, 2.0, 0.05), (0.5, 0.0, -0.13)),
        ("post", (0.08, 0.08, 0.9), (0.45, 0.0, 0.35)),
        ("shelf", (0.3, 0.6, 0.03), (0.4, 0.65, 0.55)),
    ):
        scene.add(ag.Box(size=size), name, pose=ag.Pose(xyz=xyz))
    return scene


class ClearStates(base.StateValidityChecker):
    """A state is valid where every pair keeps its buffer."""

    def __init__(self, space: base.SpaceInformation, checker: ag.Checker) -> None:
        super().__init__(space)
        self.checker, self.joints = checker, len(checker.q_names)

    def isValid(self, state: base.State) -> bool:
        """Whether a state is valid."""
        return bool(self.checker.clear([row(state, self.joints)])[0])


class ProvenMotions(base.MotionValidator):
    """A motion is valid where every pair provably keeps its buffer all the way."""

    def __init__(self, space: base.SpaceInformation, checker: ag.Checker) -> None:
        super().__init__(space)
        self.checker, self.joints = checker, len(checker.q_names)

    def checkMotion(self, start: base.State, end: base.State) -> bool:
        """Whether a motion is valid."""
        ends = row(start, self.joints), row(end, self.joints)
        return bool(self.checker.prove([ends[0]], [ends[1]]).proven[0])


def row(state: base.State, joints: int) -> list[float]:
    """Joint positions of a state."""
    return [state[k] for k in range(joints)]


def plan(
    checker: ag.Checker, start: np.ndarray, goal: np.ndarray, seconds: float = 10.0
) -> np.ndarray | None:
    """Joint positions of a proven path from start to goal; None if none was found."""
    space = base.RealVectorStateSpace(len(start))
    bounds = base.RealVectorBounds(len(start))
    for k in range(len(start)):
        bounds.setLow(k, checker.lower[k])
        bounds.setHigh(k, checker.upper[k])
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(ClearStates(information, checker))
    information.setMotionValidator(ProvenMotions(information, checker))
    setup.setPlanner(geometric.RRTConnect(information))
    ends = [space.allocState(), space.allocState()]
    for state, q in zip(ends, (start, goal), strict=True):
        for k, value in enumerate(q):
            state[k] = value
    setup.setStartAndGoalStates(*ends)
    checker.prove(
        [start], [start]
    )  # compiles or loads its kernels before the clock runs
    if not setup.solve(seconds) or not setup.haveExactSolutionPath():
        return None
    states = setup.getSolutionPath().getStates()
    return np.array([row(state, len(start)) for state in states])


if __name__ == "__main__":
    scene = panda_among_boxes()
    start, goal = np.array(scene.home), np.array(scene.home)
    start[0], goal[0] = -1.0, 1.0
    path = plan(ag.Checker(scene), start, goal)
    print("no path was found" if path is None else f"proven: {np.round(path, 2)}")
