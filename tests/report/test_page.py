"""The page as a browser shows it: whole, offline, and inert whatever it holds."""

import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from armguard import Guard, Pose, Scene, Sphere
from armguard.cli import main
from armguard.cli.app import app
from armguard.guard.answer import names_of
from armguard.recording import open_recording
from armguard.recording.frames import Kind, frame_of
from armguard.recording.recorded import RecordedGuard
from armguard.recording.ring import RingReader, RingWriter
from armguard.report import findings_of, gather, page, write_page
from armguard.report.findings import Event
from armguard.report.page import PLACES
from armguard.scene.bay import bay_path
from arms import simple_arm

from .conftest import EVIL, Evening

CHROMIUM = shutil.which("chromium")

needs_browser = pytest.mark.skipif(
    CHROMIUM is None, reason="there is no Chromium to look at the page with"
)

QUIET = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
]  # fmt: skip


@pytest.fixture(scope="module")
def written(evening: Evening, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page the command writes."""
    path = tmp_path_factory.mktemp("page") / "evening.html"
    result = CliRunner().invoke(app, ["report", str(evening.file), "--out", str(path)])
    assert result.exit_code == 0, result.output
    printed = " ".join(result.output.split())
    assert "In 12.5 s 2 robots were judged 3,000 times" in printed
    assert "page written to" in printed
    return path


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A browser without a screen."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        found = play.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        try:
            yield found
        finally:
            found.close()


@pytest.fixture(scope="module")
def looked(written: Path, browser) -> "Looked":
    """The page in a browser, and all it requested and complained of."""
    return Looked(browser.new_page(viewport={"width": 1280, "height": 900}), written)


class Looked:
    """A page that was opened."""

    def __init__(self, browser_page, path: Path) -> None:
        self.page = browser_page
        self.requests: list[str] = []
        self.complaints: list[str] = []
        browser_page.on("request", lambda request: self.requests.append(request.url))
        browser_page.on("console", lambda m: self.complaints.append(m.text))
        browser_page.on("pageerror", lambda e: self.complaints.append(str(e)))
        browser_page.on("dialog", self._dialog)
        browser_page.goto(path.as_uri())
        browser_page.wait_for_selector("#plot-times .main-svg", timeout=30_000)

    def _dialog(self, dialog) -> None:
        self.complaints.append(f"dialog: {dialog.message}")
        dialog.dismiss()


@needs_browser
def test_it_requests_nothing_and_complains_of_nothing(looked: Looked, written: Path):
    looked.page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
    looked.page.wait_for_timeout(300)
    assert looked.requests == [written.as_uri()]
    assert looked.complaints == []
    titles = looked.page.locator(".modebar-btn").evaluate_all(
        "all => all.map(button => button.dataset.title)"
    )
    assert "Download plot as a PNG" in titles
    assert not [title for title in titles if "hare" in title or "loud" in title]


@needs_browser
def test_every_place_is_there_and_every_link_leads_somewhere(looked: Looked):
    found = looked.page
    for name, _ in PLACES:
        assert found.locator(f"#{name}").count() == 1, name
    for target in found.locator("a").evaluate_all("all => all.map(a => a.hash)"):
        assert found.locator(f"[id='{target[1:]}']").count() == 1, target
    for name in ("states", "timeline", "headroom", "times"):
        box = found.locator(f"#plot-{name} .main-svg").first.bounding_box()
        assert box["height"] > 100, name
    assert found.locator(".small-plot").count() == 3


@needs_browser
def test_names_are_text_wherever_they_are_shown(looked: Looked):
    found = looked.page
    assert EVIL in found.locator("#near").inner_text()
    assert EVIL in found.locator("#closest").inner_text()
    assert found.locator("img").count() == 0
    assert found.evaluate("document.querySelectorAll('script').length") == 3
    texts = found.evaluate(
        "document.getElementById('plot-timeline').data.flatMap(d => d.text || [])"
    )
    assert not any("<img" in str(text) for text in texts)
    assert looked.complaints == []


@needs_browser
@pytest.mark.parametrize("width", [1280, 1024, 420])
def test_it_is_not_wider_than_its_screen(looked: Looked, width, tmp_path):
    looked.page.set_viewport_size({"width": width, "height": 900})
    looked.page.wait_for_timeout(300)
    wide = looked.page.evaluate("document.documentElement.scrollWidth")
    assert wide <= width
    looked.page.screenshot(path=tmp_path / f"report-{width}.png", full_page=True)
    assert (tmp_path / f"report-{width}.png").stat().st_size > 50_000


def test_it_is_one_file_that_names_no_place_elsewhere(written: Path):
    text = written.read_text(encoding="utf-8")
    ours = re.sub(r"<script>.*?</script>", "", text, count=1, flags=re.DOTALL)
    assert len(ours) < 1_000_000
    assert "src=" not in re.sub(r"&lt;.*?onerror", "", ours)
    assert not re.findall(r"(?:href|src)=\"(?!#|data:)", ours)
    assert "default-src 'none'" in ours
    assert "no certificate" in ours


def test_text_of_a_recording_is_escaped_wherever_it_is_shown(evening: Evening):
    found = findings_of(open_recording(evening.file))
    model, halt = found.model, found.stops[0]
    calls = [
        {"call": "<x-call>", "<x-argument>": "<x-text>"},
        {"call": "allow", "<x-allow>": ["<x-item>"]},
    ]
    hostile = replace(
        found,
        source="<x-source>",
        robots=("<x-robot>", "right"),
        everyone=("<x-everyone>", "right"),
        info={"<x-key>": "<x-value>", "scene_hash": "<x-hash>", "more": {"<x-a>": 1}},
        problems=["<x-problem>"],
        events=[Event(0.0, Kind.EVENT, call) for call in calls],
        closest=[replace(found.closest[0], a="<x-body>")],
        halts=[replace(halt, verdict=replace(halt.verdict, remedy="<x-remedy>"))],
        near_misses=[
            replace(
                miss,
                verdict=replace(miss.verdict, subject="<x-subject>", why="<x-why>"),
            )
            for miss in found.near_misses
        ],
        model=model
        | {
            "robots": [
                model["robots"][0] | {"name": "<x-name>", "worst_link": "<x-link>"}
            ],
            "allowed": {"<x-source-of-pairs>": 1},
            "claims": model["claims"] | {"count": 1, "contradicted": ["<x-claim>"]},
        },
    )
    text = page(hostile)
    marks = {
        *("call", "argument", "text", "allow", "item", "source", "robot", "everyone"),
        *("key", "value", "hash", "a", "problem", "body", "remedy", "subject", "why"),
        *("name", "link", "source-of-pairs", "claim"),
    }
    assert {mark for mark in marks if f"&lt;x-{mark}&gt;" in text} == marks
    assert not re.search(r"(<|\\u003c)x-", text)


def test_it_says_what_it_is_not_and_names_the_source_of_each_assumption(written: Path):
    text = written.read_text(encoding="utf-8")
    assert "stopping figures are assumptions" in text
    assert "This page is no certificate and no safety assessment" in text


def test_without_a_place_it_is_written_beside_the_recording(evening: Evening, tmp_path):
    copy = tmp_path / "recording-1.mcap"
    copy.write_bytes(evening.file.read_bytes())
    result = CliRunner().invoke(app, ["report", str(copy)])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "recording-1.html").stat().st_size > 1_000_000
    result = CliRunner().invoke(app, ["report", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "report.html").exists()


def test_json_alone_writes_no_page(evening: Evening, tmp_path):
    copy = tmp_path / "recording-1.mcap"
    copy.write_bytes(evening.file.read_bytes())
    result = CliRunner().invoke(app, ["report", str(copy), "--json"])
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert answer["cycles"] == 3000
    assert len(answer["near_misses"]) == 3
    assert list(tmp_path.glob("*.html")) == []


def test_a_damaged_recording_is_reported_as_far_as_it_goes(evening: Evening, tmp_path):
    cut = tmp_path / "cut.mcap"
    data = evening.file.read_bytes()
    cut.write_bytes(data[: len(data) * 2 // 3])
    findings = findings_of(open_recording(cut))
    assert 0 < len(findings.series.t) < 3000
    assert findings.problems
    text = page(findings)
    assert "The recording is not whole; see below." in text


def test_what_cannot_be_read_or_written_is_said_in_words(
    evening: Evening, tmp_path, monkeypatch, capsys
):
    def complaint(*arguments: str) -> str:
        monkeypatch.setattr("sys.argv", ["armguard", "report", *arguments])
        with pytest.raises(SystemExit) as caught:
            main()
        assert caught.value.code == 2
        return " ".join(capsys.readouterr().err.split())

    assert "no such file" in complaint(str(tmp_path / "none.mcap"))
    (tmp_path / "other.mcap").write_bytes(b"nothing of the kind" * 100)
    other = complaint(str(tmp_path / "other.mcap"))
    assert "this is no MCAP file" in other
    assert "give a file that `armguard serve --record FOLDER` wrote" in other
    nowhere = str(tmp_path / "no folder" / "page.html")
    printed = complaint(str(evening.file), "--out", nowhere)
    assert "the page cannot be written" in printed


def test_a_recording_is_motion_that_may_be_run(evening: Evening):
    arguments = ["run", str(bay_path()), "--trajectory", str(evening.file), "--json"]
    answer = json.loads(CliRunner().invoke(app, arguments).stdout)
    assert answer["cycles"] == 3000
    assert answer["faults"] == 1


@pytest.fixture(scope="module")
def fixed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page about arms of mode "fixed", one of them with a name full of tags."""
    folder = tmp_path_factory.mktemp("fixed")
    scene = Scene(mode="fixed", period=0.01, buffer=0.03)
    scene.add_robot(simple_arm(joints=1), name="<b>arm<b>", home={"joint1": 0.0})
    scene.add(Sphere(radius=0.05), name="ball", pose=Pose(xyz=(0.0, 0.35, 0.2)))
    guard = Guard(scene, self_test=False)
    ring = RingWriter(folder / "ring", 1 << 20)
    reader = RingReader(folder / "ring")
    clock = [0.0]
    taped = RecordedGuard(guard, ring, monotonic=lambda: clock[0])
    for k in range(200):
        clock[0] = 0.01 * k
        taped.step([0.01 * k], clock[0])
    frames = [frame_of(row) for row in reader.unread()]
    findings = gather(frames, names_of(guard.tables))
    findings = replace(findings, source="<i>fixed<i>")
    assert findings.robots == ()
    assert [halt.robots for halt in findings.stops] == [("all",)]
    assert findings.stops[0].verdict.subject.startswith("<b>arm<b>/")
    write_page(findings, folder / "fixed.html")
    return folder / "fixed.html"


@needs_browser
def test_arms_of_mode_fixed_have_a_page_too(fixed: Path, browser):
    looked = Looked(browser.new_page(), fixed)
    looked.page.wait_for_timeout(300)
    assert looked.complaints == []
    assert looked.page.locator("main b b, main i i").count() == 0
    assert "<b>arm<b>" in looked.page.locator("#near").inner_text()
    assert looked.page.locator("h1").inner_text() == "<i>fixed<i>"
