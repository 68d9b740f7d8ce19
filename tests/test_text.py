"""Text that people read is plain technical English, in the words of the glossary."""

import ast
import inspect
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

import armguard as ag
from armguard.cli.app import app
from armguard.guard import nuisance
from armguard.respond.command import Blocked
from armguard.service.wire import Cause
from prose import FIRST_PAGES, LINK, ROOT, reading_ease, without_code

SOURCE = ROOT / "src" / "armguard"
EXAMPLES = sorted((ROOT / "examples").glob("*.md"))
FOLDERS = ("src", "tests", "benchmarks", "examples")
CODE = [path for name in FOLDERS for path in sorted((ROOT / name).rglob("*.py"))]

BANNED = {
    "'what is ...' in place of a noun": r"\bwhat (?:is|was|are|were)\b",
    "tell, told: command, report": r"\b(?:tells?|told|telling)\b",
    "somebody, nobody: the role": r"\b(?:any|every|no|some)body(?:'s)?\b",
    # "An operator who moves" is a person; the clause alone is a name for a role.
    "who: the role": r"\bwho(?:ever|m)\b|(?<![a-z,] )(?<![a-z,]\n)\bwho\b",
    "of its own: separate": r"\bof (?:her|his|its|my|our|their|your) own\b",
    "bears: has": r"\b(?:bears?|bore|bearing)\b",
    "asked for: requested": r"\bask(?:s|ed|ing)? for\b",
    "mend: fix": r"\bmend(?:s|ed|ing)?\b",
    "he: the operator": r"\b(?:he|him|his|himself)\b",
    "meant: intended": r"\bmeant\b",
    "stands: is": r"\bstands\b",
    "comers": r"\bcomers?\b",
    "doings": r"\bdoings?\b",
    "thing: name it": r"\bthings?\b",
    "whereabouts: place": r"\bwhereabouts\b",
    # Ideas of the glossary under another name.
    "wish: desired motion": r"\bwish(?:es|ed)?\b",
    "master arm: leader arm": r"\bmaster(?: arm)?\b(?! boot)",
    "cylsphere: capsule": r"\bpills?\b",
    "whim: motion of the operator": r"\bwhims?\b",
}


# A message of the protocol, whose name stays.
MESSAGE = "WISH"

# Names that clients and files rely on: the row of the message, its option, the command
# of a recorded frame, a method of Python's files, and keys of published results.
PUBLISHED = {"Wish", "wish_watchdog", "told", "tell", "joint_wish", "jerk_told"}

# The same in comments and docstrings: a name in quotation marks, or beside `asked`.
NAMED = re.compile(r"`[^`]*`|\"[^\"\s]*\"|\basked(?:,| \(k\) \|) told\b")

# Patterns that hold for text that people read, and not for every comment.
ONLY_IN_TEXT = ("'what is ...' in place of a noun", "of its own: separate")


def hits(text: str, but_for: tuple[str, ...] = ()) -> list[str]:
    """Banned patterns of a text, each with the words around it."""
    text = re.sub(rf"\b{MESSAGE}\b", "MESSAGE", text)
    return [
        f"{pattern}: ...{text[max(found.start() - 40, 0) : found.end() + 40]!r}..."
        for pattern, banned in BANNED.items()
        if pattern not in but_for
        for found in re.finditer(banned, text, re.IGNORECASE)
    ]


@pytest.mark.parametrize(
    "text",
    [
        "Slow down for what is near.",
        "Whoever moves is told to stop.",
        "The view tells the level.",
        "Nobody leads it.",
        "Somebody else has the command.",
        "who moves",
        "a process of its own",
        "No drive bears that.",
        "the velocity asked for",
        "mend the file",
        "The operator presses his button.",
        "It was not meant.",
        "It stands still.",
        "Look for comers.",
        "its doings",
        "one thing",
        "a wish of the commander",
        "Bring the master to it.",
    ],
)
def test_a_banned_pattern_is_found(text):
    assert hits(text)


@pytest.mark.parametrize(
    "text",
    [
        "An operator who pushes on is slowed.",
        "Nothing is near; anything else is a standstill.",
        "It recommends a posture and amends none.",
        "The message WISH is valid for 0.1 s.",
        "What must a client do?",
    ],
)
def test_plain_english_passes(text):
    assert not hits(text)


def pages() -> list[Path]:
    """Pages that people read."""
    return [*sorted(ROOT.glob("*.md")), *sorted(ROOT.glob("docs/*.md")), *EXAMPLES]


def text_of(page: Path) -> str:
    """Text of a page without code and targets of links.

    Without tables as well, if a campaign has written it.
    """
    text = LINK.sub(r"\1", without_code(page.read_text(encoding="utf-8")))
    if re.search(r"Written by|writes this page|^# Mutation run", text[:500]):
        text = re.sub(r"^\|.*$", "", text, flags=re.MULTILINE)
    return text


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.stem)
def test_pages(page):
    assert not hits(text_of(page))


@pytest.mark.parametrize("page", FIRST_PAGES, ids=lambda page: page.stem)
def test_the_first_pages_are_easy_to_read(page):
    assert reading_ease(page) >= 50.0


def commands(command: Any) -> Iterator[Any]:
    """A command and all commands below it."""
    yield command
    for below in getattr(command, "commands", {}).values():
        yield from commands(below)


def help_of(command: Any) -> str:
    """All help of one command."""
    options = [getattr(one, "help", None) or "" for one in command.params]
    return "\n".join([command.help or "", *options])


@pytest.mark.parametrize(
    "command",
    list(commands(typer.main.get_command(app))),
    ids=lambda command: str(command.name),
)
def test_help(command):
    assert not hits(help_of(command))


@pytest.mark.parametrize("words", [ag.Reason, Blocked, Cause, nuisance.Cause])
def test_sentences_of_enumerations(words):
    said = [vars(one).get(k, "") for one in words for k in ("sentence", "remedy")]
    assert not hits("\n".join(filter(None, said)))
    assert not hits(inspect.getdoc(words) or "")


def strings(node: ast.AST) -> Iterator[str]:
    """Text of the strings in a tree, the pieces of a formatted one in their order."""
    if isinstance(node, ast.JoinedStr):
        parts = [p.value if isinstance(p, ast.Constant) else "X" for p in node.values]
        yield "".join(map(str, parts))
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    else:
        for below in ast.iter_child_nodes(node):
            yield from strings(below)


def without_docstrings(tree: ast.AST) -> ast.AST:
    """The same tree; strings that are statements are left out."""
    for node in ast.walk(tree):
        for field in ("body", "orelse", "finalbody"):
            block = getattr(node, field, None)
            if isinstance(block, list):
                kept = [
                    line
                    for line in block
                    if not (
                        isinstance(line, ast.Expr)
                        and isinstance(line.value, ast.Constant)
                    )
                ]
                setattr(node, field, kept)
    return tree


def sources(*folders: str) -> list[Path]:
    """Source files below these folders of the package."""
    found = (path for folder in folders for path in (SOURCE / folder).rglob("*.py"))
    return sorted(found)


@pytest.mark.parametrize("path", sources("."), ids=lambda path: path.stem)
def test_errors(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    raised = [node for node in ast.walk(tree) if isinstance(node, ast.Raise)]
    said = [text for node in raised for text in strings(node) if " " in text]
    assert not hits("\n".join(said))


@pytest.mark.parametrize("path", sources("."), ids=lambda path: path.stem)
def test_words_of_messages_the_page_and_the_report(path):
    tree = without_docstrings(ast.parse(path.read_text(encoding="utf-8")))
    assert not hits("\n".join(text for text in strings(tree) if " " in text))


def words_of_names(source: str) -> list[str]:
    """Each name of a source file as words, those that are published left out."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    names = {token.string for token in tokens if token.type == tokenize.NAME}
    parts = re.compile(r"_+|(?<=[a-z0-9])(?=[A-Z])")
    return [parts.sub(" ", name) for name in sorted(names - PUBLISHED)]


def remarks(source: str) -> list[str]:
    """Comments of a source file, and its docstrings, also private ones."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    comments = [token.string for token in tokens if token.type == tokenize.COMMENT]
    docstrings = [
        node.value.value
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    ]
    return ["\n".join(comments), *docstrings]


def code_hits(source: str) -> list[str]:
    """Banned patterns in names, comments and docstrings of a source file."""
    said = [NAMED.sub("NAME", text) for text in remarks(source)]
    texts = [". ".join(words_of_names(source)), *said]
    return [hit for text in texts for hit in hits(text, but_for=ONLY_IN_TEXT)]


@pytest.mark.parametrize(
    "source",
    [
        "told_at = 1",
        "AS_WISHED = 1",
        "class DoingLess: ...",
        "def f(thing): ...",
        "who = 1",
        "# It stands still.",
        'def _f():\n    """What robots are told."""',
        'SIZE = 1\n"""A number of things."""',
    ],
)
def test_a_banned_pattern_is_found_in_code(source):
    assert code_hits(source)


@pytest.mark.parametrize(
    "source",
    [
        "HAS_WISH = Kind.WISH",
        "frame.told = settings.wish_watchdog",
        "# The row `told` of a frame; a WISH follows.",
    ],
)
def test_published_names_pass_in_code(source):
    assert not code_hits(source)


@pytest.mark.parametrize("path", CODE, ids=lambda path: path.stem)
def test_names_comments_and_docstrings(path):
    assert not code_hits(path.read_text(encoding="utf-8"))


# Comments, and strings with more than one word, of C and JavaScript.
REMARK = re.compile(r"/\*[\s\S]*?\*/|^\s*//.*$", re.MULTILINE)
STRING = re.compile(r"\"[^\"\n]* [^\"\n]*\"|`[^`]* [^`]*`")


def templates() -> list[Path]:
    """Files that hold text beside Python: of the page, the report, scenes, examples."""
    page, report = SOURCE / "view" / "page", SOURCE / "report" / "templates"
    examples = ROOT / "examples"
    return sorted(
        [
            *(*page.glob("*.js"), *page.glob("*.css"), *report.glob("*.j2")),
            *(*examples.glob("*.h"), *examples.glob("*.c"), *examples.glob("*.yaml")),
            *(SOURCE / "scene").rglob("*.yaml"),
        ]
    )


@pytest.mark.parametrize("path", templates(), ids=lambda path: path.name)
def test_templates(path):
    text = path.read_text(encoding="utf-8")
    if path.suffix in (".js", ".h", ".c"):
        text = "\n".join([*REMARK.findall(text), *STRING.findall(text)])
    elif path.suffix == ".j2":
        text = re.sub(r"\{[{%#].*?[}%#]\}|<[^>]*>", " ", text, flags=re.DOTALL)
    assert not hits(text)


def docstrings(name: str) -> Iterator[str]:
    """Docstrings of a public name and of its members."""
    one = getattr(ag, name)
    if isinstance(one, dict):
        return
    members = [m for n, m in inspect.getmembers(one) if not n.startswith("_")]
    for member in (one, *(members if inspect.isclass(one) else ())):
        if inspect.isclass(member) or callable(member) or isinstance(member, property):
            yield inspect.getdoc(member) or ""


@pytest.mark.parametrize("name", ag.__all__)
def test_public_docstrings(name):
    assert not hits("\n".join(docstrings(name)))
