"""How a tool follows the joints of its robot."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.robot.kinematics import FIXED, PRISMATIC
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Damping of the inverse where the tool is near a singular pose [m], [rad].
DAMPING = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Tool:
    """A link whose velocity somebody asks for.

    Attributes:
        link: Its name, 'robot/link'.
        own: Its robot's part of q.
        body: Its body.
        p_body: Its origin in the body's frame, shape (3,) [m].
        R_body: Its rotation there, shape (3, 3).
        chain: Bodies with a joint, from the root to it.
        tables: The scene.
    """

    link: str
    own: slice
    body: int
    p_body: Floats
    R_body: Floats
    chain: tuple[int, ...]
    tables: SceneTables

    def point(self, T_world: Floats) -> Floats:
        """Its origin in the world, shape (3,) [m].

        Args:
            T_world: Poses of all bodies, rows of [R | p], shape (b, 12).
        """
        T = T_world[self.body].reshape(3, 4)
        p: Floats = T[:, :3] @ self.p_body + T[:, 3]
        return p

    def jacobian(self, T_world: Floats) -> Floats:
        """Velocity of its origin, then its angular velocity, by joint, shape (6, n)."""
        own = np.fromiter(self.chain, dtype=np.intp)
        t = self.tables
        T = T_world[own].reshape(-1, 3, 4)
        g = t.gain[own, 0]
        axis = g[:, None] * np.einsum("kij,kj->ki", T[:, :, :3], t.axis[own])
        x, y, z = (self.point(T_world) - T[:, :, 3]).T
        a, b, c = axis.T
        columns = np.stack([b * z - c * y, c * x - a * z, a * y - b * x, a, b, c])
        slides = t.joint_kind[own] == PRISMATIC
        columns[:3, slides] = axis[slides].T
        columns[3:, slides] = 0.0
        J = np.zeros((6, self.own.stop - self.own.start))
        # One joint may move several bodies of a chain.
        np.add.at(J.T, t.q_index[own] - self.own.start, columns.T)
        return J


def tool_of(tables: SceneTables, name: str) -> Tool:
    """The tool of a robot, or a link of one.

    Args:
        tables: The scene.
        name: A robot's name, or 'robot/link'.
    """
    robot = name.split("/", 1)[0]
    part = next(p for p in tables.robots if p.name == robot)
    link = part.tool if name == robot else name
    frame = tables.links[link]
    chain, body = [], frame.body
    while body >= 0:
        if tables.joint_kind[body] != FIXED:
            chain.append(body)
        body = int(tables.parent[body])
    return Tool(
        link=link,
        own=slice(part.first_joint, part.first_joint + part.joint_count),
        body=frame.body,
        p_body=frame.T_body_link[:3, 3],
        R_body=frame.T_body_link[:3, :3],
        chain=tuple(reversed(chain)),
        tables=tables,
    )


def joint_velocity(J: Floats, twist: Floats) -> Floats:
    """Joint velocities for a twist of a tool, damped least squares, shape (n,).

    Args:
        J: Jacobian, of several tools one above the other, shape (6k, n).
        twist: Velocity of the tool's origin, then its angular velocity, both in the
            world, shape (6k,) [m/s], [rad/s].

    References:
        Wampler, Manipulator inverse kinematic solutions based on vector formulations
        and damped least-squares methods, 1986.
    """
    damped = J @ J.T + DAMPING**2 * np.eye(len(J))
    v: Floats = J.T @ np.linalg.solve(damped, twist)
    return v
