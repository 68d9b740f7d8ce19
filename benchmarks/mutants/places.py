"""Where mutants may be: every expression of every kernel of the deciding folders."""

import ast
from collections import Counter
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from mutants.operators import Operator, operators, statement_operators

# As many numbers as the switch has marks for: `switch.ROOM`.
ROOM = 1 << 22

# Operators that put a constant or another place there; that change the value as it is.
ALONE = ("always", "never", "not written", "nothing added", "doubled", "halved")
WHOLE = ("times 0.97", "half")

# Folders of the package whose kernels decide.
FOLDERS = ("motion", "guard", "respond", "index")


@dataclass(frozen=True)
class Mutant:
    """One change of one line.

    Attributes:
        identity: Hash of file, function, line, change; it outlives edits elsewhere.
        file: Below the package.
        function: The kernel.
        line: The line's text.
        number: What the switch is at.
        change: Name of the operator, or of the entry in named.yaml.
        before: The expression.
        after: What is made of it.
        source: Digest of the function.
        at: The line's number when it was built.
        by_hand: Whether named.yaml has it.
    """

    identity: str
    file: str
    function: str
    line: str
    number: int
    change: str
    before: str
    after: str
    source: str
    at: int
    by_hand: bool


class Place(NamedTuple):
    """A mutant, the expression it is made of, and how."""

    mutant: Mutant
    node: ast.expr
    operator: Operator

    @property
    def alone(self) -> bool:
        """Whether the mutant has nothing of what the original works out."""
        return self.mutant.change in ALONE or self.mutant.by_hand

    @property
    def parts(self) -> bool:
        """Whether it is made of the expression's operands, not of the whole."""
        return self.mutant.change not in WHOLE


class Named(NamedTuple):
    """A mutant by hand: in a function, this expression becomes that."""

    name: str
    file: str
    function: str
    before: str
    after: str


class Kernel:
    """A function of a file that is decorated with @kernel, and its mutants.

    Args:
        file: Below the package.
        text: The file's text.
        node: The function.
    """

    def __init__(self, file: str, text: str, node: ast.FunctionDef) -> None:
        self.file, self.lines, self.node = file, text.splitlines(), node
        self.source = sha256(ast.dump(node).encode()).hexdigest()[:12]
        self._seen: Counter[str] = Counter()

    def place(
        self, node: ast.expr, change: str, operator: Operator, by_hand: bool = False
    ) -> Place:
        """A mutant with its identity; equal ones are counted."""
        line = " ".join(self.lines[node.lineno - 1].split())
        before, after = ast.unparse(node), ast.unparse(operator(deepcopy(node)))
        what = "|".join((self.file, self.node.name, line, change, before, after))
        self._seen[what] += 1
        identity = sha256(f"{what}|{self._seen[what]}".encode()).hexdigest()[:12]
        mutant = Mutant(
            identity=identity,
            file=self.file,
            function=self.node.name,
            line=line,
            number=int(identity, 16) % ROOM,
            change=change,
            before=before,
            after=after,
            source=self.source,
            at=node.lineno,
            by_hand=by_hand,
        )
        return Place(mutant, node, operator)


def kernels(file: str, text: str, tree: ast.Module) -> Iterator[Kernel]:
    """The kernels of a file."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and any(
            ast.unparse(d).startswith("kernel") for d in node.decorator_list
        ):
            yield Kernel(file, text, node)


def places(file: str, text: str, tree: ast.Module) -> Iterator[Place]:
    """Every mutant that the operators make of a file, in the order of its lines."""
    for kernel in kernels(file, text, tree):
        for node, name, operator in changes(kernel.node):
            yield kernel.place(node, name, operator)


def named_places(
    file: str, text: str, tree: ast.Module, named: list[Named]
) -> Iterator[Place]:
    """The mutants by hand of a file.

    Raises:
        LookupError: A function or an expression is not there any more.
    """
    for one in [one for one in named if one.file == file]:
        own = [k for k in kernels(file, text, tree) if k.node.name == one.function]
        if not own:
            raise LookupError(f"{one.name}: {file} has no kernel {one.function}")
        before, after = expression(one.before), expression(one.after)
        for node in ast.walk(own[0].node):
            if isinstance(node, ast.expr) and ast.unparse(node) == ast.unparse(before):
                break
        else:
            raise LookupError(f"{one.name}: {one.function} has no '{one.before}'")
        yield own[0].place(node, one.name, partial(replaced, after), True)


def replaced(after: ast.expr, _: ast.expr) -> ast.expr:
    """The operator that puts another expression in the place of any."""
    return deepcopy(after)


def expression(text: str) -> ast.expr:
    """An expression from its text."""
    return ast.parse(text, mode="eval").body


def changes(function: ast.FunctionDef) -> Iterator[tuple[ast.expr, str, Operator]]:
    """Every expression of a kernel with every operator that fits it."""
    for statement in ast.walk(function):
        if not isinstance(statement, ast.stmt) or statement is function:
            continue
        for name, operator in statement_operators(statement):
            yield statement.value, name, operator  # type: ignore[attr-defined]
        for node in expressions_of(statement):
            for name, operator in operators(node):
                yield node, name, operator


def expressions_of(statement: ast.stmt) -> Iterator[ast.expr]:
    """Expressions of a statement itself that are values, not places or counts."""
    match statement:
        case ast.Assign() | ast.AugAssign() | ast.Return() | ast.Expr():
            roots = [statement.value]
        case ast.If():
            roots = [statement.test]
        case _:
            # A loop that never ends says nothing.
            roots = []
    while roots:
        node = roots.pop(0)
        if node is None or isinstance(
            node, ast.GeneratorExp | ast.ListComp | ast.Lambda
        ):
            continue
        yield node
        for field, child in ast.iter_fields(node):
            if field in ("slice", "func") or is_range(node):
                continue
            children = child if isinstance(child, list) else [child]
            roots += [c for c in children if isinstance(c, ast.expr)]


def is_range(node: ast.expr) -> bool:
    """Whether an expression counts."""
    return isinstance(node, ast.Call) and ast.unparse(node.func) in ("range", "int")


def deciding_files(package: Path) -> list[str]:
    """Files with kernels of the deciding folders, below the package."""
    return [
        path.relative_to(package).as_posix()
        for folder in FOLDERS
        for path in sorted((package / folder).glob("*.py"))
        if "@kernel" in path.read_text("utf-8")
    ]
