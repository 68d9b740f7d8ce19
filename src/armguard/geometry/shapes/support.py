"""Shapes known by their support function alone: how a new one is added."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, ClassVar, Self

import numba
import numpy as np
from numba import carray, cfunc, types

from armguard.errors import ShapeError
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import Floats, framed_row
from armguard.geometry.shapes.sizes import check_size

SupportFunction = Callable[..., tuple[float, float, float]]

# Numbers a support function may be given.
PARAMETERS = 16


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SupportShape:
    """A convex shape given by its support function; see docs/adding-a-shape.md.

    A subclass declares `support`, and `numbers` if it has parameters. The function is
    compiled once, when the first shape of the class is made; the cycle calls it by its
    address and is not compiled again.

    Attributes:
        rounding: Growth outwards [m].

    Raises:
        ShapeError: The rounding is negative, a parameter is not finite, or the support
            function gives something else than three finite numbers.
    """

    kind: ClassVar[ShapeKind] = ShapeKind.SUPPORT
    rounding: float = 0.0
    parameters: Floats = field(init=False, repr=False)
    function: Any = field(init=False, repr=False)
    reach: float = field(init=False, repr=False)

    @staticmethod
    def support(p: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
        """The farthest point of the core in a direction, in the shape's frame [m].

        Args:
            p: The shape's numbers, shape (PARAMETERS,).
            x: Direction, of any length but 0.
            y: Direction.
            z: Direction.
        """
        raise TypeError("a SupportShape needs its own support function")

    @classmethod
    def example(cls, rng: np.random.Generator, size: float) -> Self:
        """A random one of about this size [m], for the tests."""
        raise TypeError("a registered SupportShape needs its own examples")

    def numbers(self) -> Sequence[float]:
        """The parameters its support function reads, at most PARAMETERS."""
        return ()

    def __post_init__(self) -> None:
        """Compile the function, try it."""
        name = type(self).__name__
        check_size(name, "rounding", self.rounding, zero=True)
        numbers = np.zeros(PARAMETERS)
        given = np.asarray(self.numbers(), dtype=np.float64)
        if given.ndim != 1 or len(given) > PARAMETERS or not np.isfinite(given).all():
            raise ShapeError(
                f"{name} numbers are {given}; they must be at most {PARAMETERS} "
                "finite ones"
            )
        numbers[: len(given)] = given
        object.__setattr__(self, "parameters", numbers)
        object.__setattr__(self, "function", compiled_support(type(self).support))
        object.__setattr__(self, "reach", self._bound())

    @property
    def core_radius(self) -> float:
        """Radius the core is grown by [m]."""
        return self.rounding

    def _bound(self) -> float:
        """Bound on the distance of a point of the core from the origin [m].

        The corner of its bounding box, which six supports give.
        """
        extent = np.zeros(3)
        for k in range(3):
            for sign in (-1.0, 1.0):
                d = np.zeros(3)
                d[k] = sign
                point = type(self).support(self.parameters, *d)
                if np.shape(point) != (3,) or not np.isfinite(point).all():
                    raise ShapeError(
                        f"{type(self).__name__} support in direction {d} is {point}; "
                        "it must be three finite numbers"
                    )
                extent[k] = max(extent[k], abs(point[k]))
        return float(np.linalg.norm(extent))

    def row(self, T: Floats) -> Floats:
        """Table row with the frame at T; the shape must outlive it."""
        sizes = (self.parameters.ctypes.data, self.function.address, self.reach)
        return framed_row(self.rounding, T, sizes)


@cache
def compiled_support(support: SupportFunction) -> Any:
    """A support function as machine code with an address."""
    inner = numba.njit(error_model="numpy", nogil=True)(support)
    number = types.float64
    numbers = types.CPointer(number)

    @cfunc(types.void(numbers, number, number, number, numbers), error_model="numpy")  # type: ignore[untyped-decorator]
    def by_address(p: Any, x: float, y: float, z: float, out: Any) -> None:
        point = inner(carray(p, (PARAMETERS,)), x, y, z)
        answer = carray(out, (3,))
        answer[0], answer[1], answer[2] = point[0], point[1], point[2]

    return by_address
