"""Pages lead where they say; the site builds, and has every public name."""

import ast
import re
import subprocess
import sys
import typing
from pathlib import Path

import pytest

import armguard as ag
from armguard.respond import command
from armguard.service.client import Answer

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("examples/*.md")]
)


def anchors(page: Path) -> set[str]:
    """What a page's headings are called in links."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings)
    return {heading.strip().replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_somewhere(page):
    links = re.findall(
        r"\]\(([^)#\s]*)(?:#([^)\s]+))?\)", page.read_text(encoding="utf-8")
    )
    for target, anchor in links:
        if target.startswith(("http:", "https:")):
            continue
        other = page.parent / target if target else page
        assert other.exists(), target
        if anchor:
            assert anchor in anchors(other), f"{target}#{anchor}"


def names_in(file: Path) -> tuple[set[str], set[str]]:
    """Functions that a file defines, and names that it uses."""
    nodes = [*ast.walk(ast.parse(file.read_text(encoding="utf-8")))]
    used = {node.id for node in nodes if isinstance(node, ast.Name)}
    used |= {node.attr for node in nodes if isinstance(node, ast.Attribute)}
    return {node.name for node in nodes if isinstance(node, ast.FunctionDef)}, used


@pytest.mark.parametrize("of", ["a joint position", "a message"])
def test_every_step_of_a_path_is_a_function_that_a_step_above_calls(of):
    page = ROOT / "docs" / "architecture.md"
    text = page.read_text(encoding="utf-8").split(f"## The path of {of}\n")[1]
    steps = re.findall(r"\[`(\w+)`\]\(([^)]+)\)", text.split("\n## ")[0])
    assert len(steps) > 10
    above: set[str] = {steps[0][0]}
    for name, target in steps:
        defined, used = names_in(page.parent / target)
        above |= used
        assert name in defined, f"{name} of {target}"
        assert name in above, name


def test_every_page_can_be_reached_from_the_readme():
    seen: set[Path] = set()
    ahead = [ROOT / "README.md"]
    while ahead:
        page = ahead.pop().resolve()
        if page in seen:
            continue
        seen.add(page)
        for target in re.findall(
            r"\]\(([^)#\s]+\.md)", page.read_text(encoding="utf-8")
        ):
            if not target.startswith(("http:", "https:")):
                ahead.append(page.parent / target)
    assert {page.resolve() for page in PAGES} <= seen


def documented() -> set[str]:
    """Names with an entry in the page of the Python API."""
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    return {name.rsplit(".", 1)[1] for name in re.findall(r"^::: (\S+)$", page, re.M)}


def returned(hint: object) -> set[str]:
    """Names of the package's classes in a type hint."""
    if isinstance(hint, type) and hint.__module__.startswith("armguard."):
        return {hint.__name__}
    return set().union(*map(returned, typing.get_args(hint)))


def test_the_api_page_has_every_public_name():
    assert set(ag.__all__) <= documented()


@pytest.mark.parametrize("one", [ag.Verdict, ag.Command, ag.Held, ag.Client, Answer])
def test_the_api_page_has_the_classes_that_members_return(one):
    # An answer imports the words of the guard late; all of them are known to commands.
    names = vars(command) | vars(sys.modules[one.__module__])
    for name in dir(one):
        member = getattr(one, name)
        function = member.fget if isinstance(member, property) else member
        if not name.startswith("_") and callable(function):
            hints = typing.get_type_hints(function, names)
            assert returned(hints.get("return")) <= documented(), name


def test_the_site_builds_without_a_warning_and_loads_nothing_from_a_network(tmp_path):
    build = ["-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir"]
    subprocess.run([sys.executable, *build, str(tmp_path)], cwd=ROOT, check=True)
    api = (tmp_path / "api.html").read_text(encoding="utf-8")
    for name in ag.__all__:
        assert f'id="armguard.{name}"' in api, name
    for page in tmp_path.glob("*.html"):
        loaded = r"<(?:script|img|link)\b[^>]*(?:src|href)=\"?http[^>]*>"
        assert not re.findall(loaded, page.read_text(encoding="utf-8")), page.name
