"""A copy of the package that holds every mutant: chosen, rewritten, written."""

import ast
import random
from collections.abc import Iterable
from copy import deepcopy
from pathlib import Path

from ruamel.yaml import YAML

from mutants.places import Mutant, Named, Place, deciding_files, named_places, places

HERE = Path(__file__).parent
NAMED = HERE / "named.yaml"

# What takes part, and how often beside others; what only words or draws does not.
WEIGHTS = {
    "motion/": 1.6,
    "guard/": 1.2,
    "respond/": 0.7,
    "index/": 0.7,
    "guard/proofs.py": 2.5,
    "guard/needs.py": 2.5,
    "guard/relief.py": 2.5,
    "guard/stops.py": 2.0,
    "guard/observe.py": 2.5,
    "guard/commands.py": 2.0,
    "guard/change.py": 2.5,
    "guard/limits.py": 2.0,
    "guard/hanging.py": 2.0,
    "guard/intent.py": 0.7,
    "guard/contracts.py": 0.6,
    "guard/gripper_model.py": 0.5,
    "guard/finger_way.py": 0.5,
    "guard/contact_times.py": 0.5,
    "guard/explain.py": 0.0,
    "guard/cues.py": 0.0,
    "guard/sorting.py": 0.0,
    "guard/grips.py": 0.0,
    "respond/field.py": 0.5,
    "respond/escape_path.py": 0.4,
    "respond/escape_ways.py": 0.4,
    "respond/tool_motion.py": 0.4,
    "respond/tool_asking.py": 0.0,
    "respond/leading.py": 0.5,
}

# What only hands memory over has nothing to decide.
PLUMBING = ("open_", "begin_", "write_row", "describe_")

# The copy of switch.py.
SWITCH = Path("mutant_switch.py")
IMPORT = "from armguard.mutant_switch import pick"


def weight_of(file: str) -> float:
    """How often a file's mutants are drawn beside others."""
    return WEIGHTS.get(file, WEIGHTS[f"{Path(file).parts[0]}/"])


def read_named(path: Path) -> list[Named]:
    """The mutants by hand."""
    return [Named(**entry) for entry in YAML(typ="safe").load(path) or []]


def choose(
    found: Iterable[Place], by_hand: list[Place], count: int, seed: int
) -> list[Place]:
    """Those by hand, and as many others: each function's share by its size and weight.

    Each is drawn by its identity, so an edit of one function changes no other's. No
    expression has two, and none lies within one by hand.
    """
    taken = {id(node) for one in by_hand for node in ast.walk(one.node)}
    by_node: dict[int, list[Place]] = {}
    for one in found:
        free = id(one.node) not in taken
        if free and weight_of(one.mutant.file) > 0.0:
            if not one.mutant.function.startswith(PLUMBING):
                by_node.setdefault(id(one.node), []).append(one)

    def drawn(one: Place) -> float:
        draw = random.Random(f"{seed}|{one.mutant.identity}").random()
        return float(draw ** (1.0 / weight_of(one.mutant.file)))

    one_each = [max(several, key=drawn) for several in by_node.values()]
    others = sorted(one_each, key=drawn, reverse=True)
    return by_hand + others[: max(count - len(by_hand), 0)]


class Rewriter(ast.NodeTransformer):
    """Puts `pick(number, original, mutated)` in place of each chosen expression.

    Operands that are more than a look into memory are worked out once, as arguments of
    a kernel that picks.

    Attributes:
        kernels: Those kernels.
    """

    def __init__(self, chosen: Iterable[Place]) -> None:
        self.chosen: dict[int, list[Place]] = {}
        for one in chosen:
            self.chosen.setdefault(id(one.node), []).append(one)
        self.kernels: list[ast.stmt] = []

    def visit(self, node: ast.AST) -> ast.AST:
        """Rewrite the parts first, then the whole."""
        mine = self.chosen.get(id(node), [])
        node = self.generic_visit(node)
        for one in mine:
            assert isinstance(node, ast.expr)
            node = self.picked(node, one)
        return node

    def picked(self, node: ast.expr, one: Place) -> ast.expr:
        """The expression or its mutant, whichever the switch says."""
        number = one.mutant.number
        operands = operands_of(node) if one.parts else [node]
        if one.alone or not any(map(takes_time, operands)):
            return pick(number, node, one.operator(deepcopy(node)))
        names: list[ast.expr] = [
            ast.Name(f"x{k}", ast.Load()) for k in range(len(operands))
        ]
        shell = with_operands(node, names) if one.parts else names[0]
        name = f"mutant_{number}"
        text = (
            f"@kernel\ndef {name}({', '.join(map(ast.unparse, names))}):\n"
            f"    return {ast.unparse(pick(number, shell, one.operator(shell)))}"
        )
        self.kernels += ast.parse(text).body
        return ast.Call(ast.Name(name, ast.Load()), operands, [])


def pick(number: int, original: ast.expr, mutated: ast.expr) -> ast.expr:
    """The call that chooses."""
    arguments = [ast.Constant(number), original, mutated]
    return ast.Call(ast.Name("pick", ast.Load()), arguments, [])


def takes_time(node: ast.expr) -> bool:
    """Whether an expression calls anything, or may be left out."""
    return any(
        isinstance(part, ast.Call | ast.BoolOp | ast.IfExp) for part in ast.walk(node)
    )


def operands_of(node: ast.expr) -> list[ast.expr]:
    """The parts of an expression that operators are about."""
    match node:
        case ast.BinOp(left, _, right):
            return [left, right]
        case ast.Compare(left, _, [right]):
            return [left, right]
        case ast.UnaryOp(operand=operand):
            return [operand]
        case ast.Call(args=arguments):
            return list(arguments)
    return [node]


def with_operands(node: ast.expr, names: list[ast.expr]) -> ast.expr:
    """The expression with other parts."""
    match node:
        case ast.BinOp(op=op):
            return ast.BinOp(names[0], op, names[1])
        case ast.Compare(ops=ops):
            return ast.Compare(names[0], ops, [names[1]])
        case ast.UnaryOp(op=op):
            return ast.UnaryOp(op, names[0])
        case ast.Call(func=func):
            return ast.Call(func, names, [])
    return names[0]


def rewritten(tree: ast.Module, chosen: list[Place]) -> str:
    """The text of a file with its mutants in it."""
    rewriter = Rewriter(chosen)
    rewriter.visit(tree)
    imports = [
        k
        for k, node in enumerate(tree.body)
        if isinstance(node, ast.Import | ast.ImportFrom)
    ]
    after = imports[-1] + 1
    tree.body[after:after] = [*ast.parse(IMPORT).body, *rewriter.kernels]
    return ast.unparse(ast.fix_missing_locations(tree)) + "\n"


def build(
    source: Path, target: Path, count: int, seed: int, named: Path = NAMED
) -> list[Mutant]:
    """Copy the package with its mutants; what does not change is not written again.

    Args:
        source: The package's folder.
        target: Folder of the copy, the package's name within included.
        count: How many mutants.
        seed: Of the choice.
        named: File of those by hand.

    Returns:
        The mutants.
    """
    trees, found, by_hand = {}, [], []
    written = read_named(named)
    for file in deciding_files(source):
        text = (source / file).read_text("utf-8")
        trees[file] = ast.parse(text)
        found += places(file, text, trees[file])
        by_hand += named_places(file, text, trees[file], written)
    chosen = without_clashes(choose(found, by_hand, count, seed))
    wanted = files_of(source)
    for below in files_of(target).keys() - wanted.keys() - {SWITCH}:
        (target / below).unlink()
    for below, path in wanted.items():
        mine = [one for one in chosen if one.mutant.file == below.as_posix()]
        if mine:
            text = rewritten(trees[below.as_posix()], mine)
            put(target / below, text.encode())
        else:
            put(target / below, path.read_bytes())
    put(target / SWITCH, (HERE / "switch.py").read_bytes())
    return [one.mutant for one in chosen]


def files_of(folder: Path) -> dict[Path, Path]:
    """Files of a package, by their place in it."""
    return {
        path.relative_to(folder): path
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def without_clashes(chosen: list[Place]) -> list[Place]:
    """Without those whose number another one has."""
    by_number = {one.mutant.number: one for one in reversed(chosen)}
    return [one for one in chosen if by_number[one.mutant.number] is one]


def put(path: Path, content: bytes) -> None:
    """Write a file unless it holds that already: Numba looks at its time."""
    if path.exists() and path.read_bytes() == content:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
