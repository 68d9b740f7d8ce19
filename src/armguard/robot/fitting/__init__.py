"""Capsules and boxes fitted to links: containment proven, overreach measured."""

from armguard.robot.fitting.cylinders import enclose_cylinder
from armguard.robot.fitting.fit import fit_link, fit_robot
from armguard.robot.fitting.proof import uncovered

__all__ = ["enclose_cylinder", "fit_link", "fit_robot", "uncovered"]
