"""Records of a few arrays, for a kernel that looks at no more of a larger one."""

from collections import namedtuple
from functools import cache


@cache
def kind_of(names):
    """The class of records with these names: a kernel is compiled for it once."""
    return namedtuple("Record", names)


def record(**arrays):
    """A named tuple of these arrays."""
    return kind_of(tuple(arrays))(**arrays)
