"""Delegation: methods of a class that call those of its parts."""

from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")


def delegated(
    part: str, method: Callable[Concatenate[Any, Arguments], Answer]
) -> Callable[Concatenate[Any, Arguments], Answer]:
    """A method of a part as a method of the whole, signature and docstring included.

    Args:
        part: Attribute of the whole that holds the part.
        method: The method of the part's class.
    """

    @wraps(method)
    def call(whole: Any, /, *args: Arguments.args, **named: Arguments.kwargs) -> Answer:
        return method(getattr(whole, part), *args, **named)

    return call
