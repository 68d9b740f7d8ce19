"""Records of a few arrays, for a kernel that looks at no more of a larger one."""

from collections import namedtuple
from functools import cache


@cache
def kind_of(names):
    """The class of records with these names: a kernel is compiled for it once."""
    return namedtuple("__".join(("Record", *names)), names)


def __getattr__(name):
    """The class of that name, for code that another process has compiled for it."""
    begin, *names = name.split("__")
    if begin != "Record" or not names:
        raise AttributeError(name)
    return kind_of(tuple(names))


def record(**arrays):
    """A named tuple of these arrays."""
    return kind_of(tuple(arrays))(**arrays)
