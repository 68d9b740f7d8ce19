"""The code of the README and of the first pages runs as shown."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

import armguard as ag

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = ("index", "install", "your-robot", "your-loop", "when-it-stops", "concepts")
BLOCK = re.compile(
    r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```', re.MULTILINE | re.DOTALL
)


def blocks(page: Path, language: str) -> list[str]:
    """Code blocks of a page in one language, in their order."""
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    return [code for kind, _, code in found if kind == language]


def test_the_code_of_the_readme_runs(capsys):
    scene, loop = blocks(ROOT / "README.md", "python")
    assert len(scene.splitlines()) <= 10
    assert len(loop.splitlines()) <= 10
    exec(compile(scene + loop, "README.md", "exec"), {})
    printed = capsys.readouterr().out
    # Both follow, but almost nothing of their desired motion is commanded.
    assert printed.count("Action.FOLLOW") == 2
    assert " mm from right/" in printed


@pytest.mark.parametrize("page", PAGES)
def test_the_code_of_a_page_runs(page, tmp_path, monkeypatch):
    path = DOCS / f"{page}.md"
    for _, title, text in BLOCK.findall(path.read_text(encoding="utf-8")):
        if title:
            (tmp_path / title).write_text(text)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for code in blocks(path, "python"):
        exec(compile(code, path.name, "exec"), names)
    assert names or page == "concepts"


@pytest.mark.parametrize("rate", [500, 1000])
def test_the_loop_of_the_page_runs_at_other_rates(rate):
    (code,) = blocks(DOCS / "your-loop.md", "python")
    assert "RATE = 50 " in code
    names: dict[str, object] = {}
    exec(compile(code.replace("RATE = 50 ", f"RATE = {rate} "), "loop", "exec"), names)
    assert names["command"].verdict.level < ag.Level.STOP


def test_the_loop_of_the_page_is_refused_at_another_rate_than_it_states():
    (code,) = blocks(DOCS / "your-loop.md", "python")
    code = code.replace("period=1 / RATE", "period=0.001")
    with pytest.raises(AssertionError):
        exec(compile(code, "loop", "exec"), {})


@pytest.mark.skipif(shutil.which("cc") is None, reason="no compiler of C")
def test_the_c_code_of_the_pages_compiles(tmp_path):
    (program,) = blocks(DOCS / "your-loop.md", "c")
    (line,) = blocks(DOCS / "when-it-stops.md", "c")
    assert line.strip() in program
    source = tmp_path / "loop.c"
    source.write_text(program)
    strict = ["-std=gnu11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only"]
    subprocess.run(["cc", *strict, f"-I{ROOT / 'examples'}", str(source)], check=True)
