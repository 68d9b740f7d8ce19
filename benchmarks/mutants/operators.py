"""What single change is made of an expression: the operators of the mutation run.

Every operator takes an expression and returns another of the same type, so that the
compiled code holds both and a switch chooses. Only floats and truth values are mutated:
a wrong whole number is a wrong address here, which says nothing about a decision.
"""

import ast
from collections.abc import Callable, Iterator
from copy import deepcopy

Operator = Callable[[ast.expr], ast.expr]

# What each comparison is when it is turned round.
OPPOSITE: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE,
    ast.LtE: ast.Gt,
    ast.Gt: ast.LtE,
    ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
}

# Bounds are made this much smaller: a test near the bound notices, one far off not.
NEARLY = 0.97


# Names of whole numbers, by which arithmetic is known not to be of floats.
COUNTS = {"first", "count", "node", "at", "place", "rows", "k", "n", "i", "r"}


def operators(node: ast.expr) -> Iterator[tuple[str, Operator]]:
    """Every operator that fits an expression, by name."""
    if isinstance(node, ast.BinOp) and (counts(node.left) or counts(node.right)):
        return
    match node:
        case ast.BinOp(op=ast.Add()):
            yield "left term only", lambda e: e.left
            yield "right term only", lambda e: e.right
            yield "+ to -", lambda e: ast.BinOp(e.left, ast.Sub(), e.right)
        case ast.BinOp(op=ast.Sub()):
            yield "left term only", lambda e: e.left
            yield "- to +", lambda e: ast.BinOp(e.left, ast.Add(), e.right)
        case ast.BinOp(op=ast.Mult()):
            yield "left factor only", lambda e: e.left
            yield "right factor only", lambda e: e.right
            yield "times 0.97", nearly
            yield "half", lambda e: scaled(e, 0.5)
        case ast.BinOp(op=ast.Div()):
            yield "/ to *", lambda e: ast.BinOp(e.left, ast.Mult(), e.right)
            yield "times 0.97", nearly
        case ast.Compare(ops=[op]) if type(op) in OPPOSITE:
            yield "always", lambda e: ast.Constant(True)
            yield "never", lambda e: ast.Constant(False)
            yield "turned round", turned_round
            if not is_zero(node.comparators[0]) and type(op) not in (ast.Eq, ast.NotEq):
                yield "threshold times 0.97", nearer_threshold
        case ast.UnaryOp(op=ast.Not()):
            yield "without not", lambda e: e.operand
        case ast.UnaryOp(op=ast.USub(), operand=ast.Name() | ast.Subscript()):
            yield "without minus", lambda e: e.operand
        case ast.Call(func=ast.Name("max" | "min"), args=[_, _]):
            other = "min" if node.func.id == "max" else "max"
            yield f"{node.func.id} to {other}", lambda e: called(other, e.args)
            yield "first only", lambda e: e.args[0]
            yield "second only", lambda e: e.args[1]
        case ast.Call(func=ast.Name("abs"), args=[_]):
            yield "without abs", lambda e: e.args[0]
        case ast.Constant(float(value)) if value != 0.0:
            yield "doubled", lambda e: ast.Constant(2.0 * value)
            yield "halved", lambda e: ast.Constant(0.5 * value)


def statement_operators(node: ast.stmt) -> Iterator[tuple[str, Operator]]:
    """Operators of a statement's value, by name."""
    match node:
        case ast.AugAssign(op=ast.Add() | ast.Sub()):
            yield "nothing added", lambda e: ast.Constant(0.0)
        case ast.Assign(value=ast.Constant(int())):
            return
        case ast.Assign(targets=[ast.Subscript(slice=ast.Name()) as target]):
            # `x[k] = e` with x[k] as it was: the statement is gone.
            yield "not written", lambda e: loaded(target)
        case ast.Return(value=ast.Call(ast.Name("float")) | ast.BinOp()):
            yield "times 0.97", nearly


def nearly(node: ast.expr) -> ast.expr:
    """A little less."""
    return scaled(node, NEARLY)


def scaled(node: ast.expr, factor: float) -> ast.expr:
    """The expression times a factor."""
    return ast.BinOp(ast.Constant(factor), ast.Mult(), node)


def turned_round(node: ast.Compare) -> ast.expr:
    """The comparison that says the opposite."""
    return ast.Compare(node.left, [OPPOSITE[type(node.ops[0])]()], node.comparators)


def nearer_threshold(node: ast.Compare) -> ast.expr:
    """The comparison with a right side that is a little less."""
    return ast.Compare(node.left, node.ops, [nearly(node.comparators[0])])


def called(name: str, args: list[ast.expr]) -> ast.expr:
    """A call."""
    return ast.Call(ast.Name(name, ast.Load()), args, [])


def loaded(target: ast.expr) -> ast.expr:
    """What a place holds that is about to be written."""
    place = deepcopy(target)
    place.ctx = ast.Load()
    return place


def counts(node: ast.expr) -> bool:
    """Whether an operand is a whole number by its looks."""
    match node:
        case ast.Name(name):
            return name in COUNTS or name.endswith(("_COUNT", "_WIDTH"))
        case ast.Call(ast.Name("int")) | ast.Constant(int()):
            return True
        case ast.BinOp():
            return counts(node.left) or counts(node.right)
    return False


def is_zero(node: ast.expr) -> bool:
    """Whether an expression is the number 0."""
    return isinstance(node, ast.Constant) and node.value == 0
