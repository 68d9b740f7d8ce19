"""Links and objects of a scene, as the proofs of tubes count them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.batch.checker import Checker
from armguard.geometry.shapes import ROW_WIDTH
from armguard.lanes import WIDTH
from armguard.motion.chains import chains
from armguard.motion.joint_rows import JointRow
from armguard.prove.links import ANYHOW, APART, TOGETHER, Links
from armguard.record import records
from armguard.table import Ledger

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Arrays of the links that a call brings.
PAIRS, NEED = (Links._fields.index(name) for name in ("pairs", "need"))


class SceneLinks:
    """What has a name in a scene and a shape: links of robots, and objects.

    Attributes:
        names: Their names.
        of_primitive: Place in `names` of each primitive's, shape (p,).

    Args:
        checker: A checker of the scene.
    """

    def __init__(self, checker: Checker) -> None:
        tables, plan = checker.tables, checker.world
        names, first, of_primitive = np.unique(
            np.array(tables.body_names, dtype=np.str_),
            return_index=True,
            return_inverse=True,
        )
        self.names: list[str] = names.tolist()
        self.of_primitive = of_primitive
        # Primitives of one name follow one another in the tables.
        end = first + np.bincount(of_primitive, minlength=len(first))
        exact, count = np.maximum(plan.exact_of[first], 0).T
        self._body = np.ascontiguousarray(plan.bodies[first], dtype=np.int32)
        self._group, self._q_index = tables.groups[first], tables.q_index
        self._buffers, self._joints = tables.buffers, len(tables.q_names)
        self._chains = chains(tables)
        exact += len(plan.ball)
        spans = np.column_stack((first, end, first, end))
        spans[count > 0, 2:] = np.column_stack((exact, exact + count))[count > 0]
        shapes = len(plan.ball) + len(plan.exact_kinds)
        self._ledger = Ledger(self._table(spans, shapes))

    def pairs_of(self, primitives: NDArray[np.int64]) -> NDArray[np.int64]:
        """One number for the two links of each pair of primitives, shape (k,).

        Args:
            primitives: The pairs, shape (k, 2).
        """
        both = np.sort(self.of_primitive[primitives], axis=1)
        return np.asarray(both[:, 0] * len(self.names) + both[:, 1], dtype=np.int64)

    def ends_of(self, numbers: NDArray[np.int64]) -> NDArray[np.int64]:
        """Both links of such numbers, shape (k, 2)."""
        return np.column_stack(np.divmod(numbers, len(self.names)))

    def buffers(self, pairs: NDArray[np.int64]) -> Floats:
        """Distance that each pair of links has to keep, shape (k,) [m]."""
        return np.asarray(
            self._buffers[self._group[pairs[:, 0]], self._group[pairs[:, 1]]]
        )

    def ledger(self, pairs: NDArray[np.int64], need: Floats, owner: Ints) -> Ledger:
        """Pairs of links as kernels read them, until the next call.

        Args:
            pairs: Places in `names`, shape (k, 2).
            need: Distance that each is compared with, shape (k,) [m].
            owner: Parameter that each joint follows, shape (n,).
        """
        a, b = self._body[pairs].T
        both = (a >= 0) & (b >= 0)
        shared = np.where(both, self._chains.shared[a, b], 0)
        rows = np.column_stack((pairs, shared, self._follows(pairs, owner)))
        self._ledger.put(PAIRS, np.ascontiguousarray(rows, dtype=np.int32))
        self._ledger.put(NEED, np.ascontiguousarray(need, dtype=np.float64))
        return self._ledger

    def _follows(self, pairs: NDArray[np.int64], owner: Ints) -> NDArray[np.int64]:
        """TOGETHER, APART or ANYHOW for each pair, shape (k,)."""
        if not owner.any():
            return np.full(len(pairs), TOGETHER)
        # A bit for each parameter that a joint of the link follows.
        bits = np.zeros(len(self._body), dtype=np.int64)
        for link, body in enumerate(self._body):
            for b in self._chains.joints[body, : self._chains.length[body]]:
                bits[link] |= 0 if body < 0 else 1 << int(owner[self._q_index[b]])
        a, b = bits[pairs].T
        together = np.bitwise_count(a | b) <= 1
        apart = (np.bitwise_count(a) <= 1) & (np.bitwise_count(b) <= 1)
        return np.where(together, TOGETHER, np.where(apart, APART, ANYHOW))

    def _table(self, spans: Ints, shapes: int) -> Links:
        """Links without a pair, for shapes in these places, and so many in all."""
        depth = self._chains.joints.shape[1]
        bodies, joints = len(self._chains.length), self._joints
        scratch: dict[str, Any] = {
            name: np.zeros(joints)
            for name in ("q", "line", "bow", "wide", "away", "slope")
        }
        return Links(
            body=self._body,
            spans=spans.astype(np.int32),
            pairs=np.zeros((0, 4), dtype=np.int32),
            need=np.zeros(0),
            joints=self._chains.joints,
            length=self._chains.length,
            **scratch,
            T=np.zeros((bodies, 12)),
            axes=np.zeros((bodies, 6)),
            size=np.zeros(bodies),
            drift=np.zeros(bodies),
            turn=np.zeros(1, dtype=np.int64),
            placed=np.zeros((len(spans), 4), dtype=np.int64),
            rows=np.zeros((shapes, ROW_WIDTH)),
            reaches=np.zeros((shapes, depth)),
            sway=np.zeros((shapes, 2)),
            lever_rows=records(depth, JointRow),
            hessian=np.zeros((depth, WIDTH * depth)),
        )
