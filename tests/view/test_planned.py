"""The view of a plan: its swept volumes as they are, and a time line of its cycles."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import armguard as ag
from armguard.cli.app import app
from armguard.plans.pieces import Piece, spans
from armguard.recording.palette import ROBOT_TINTS, STATE_COLOURS, State
from armguard.view import __main__ as showing
from armguard.view.drawables import slug
from armguard.view.planned_view import PlannedView, SweptVolumes, outside_of, too_near
from crossing import cell_of

# First joints of both arms, which meet in the middle of the plan [rad].
TURNS = {"left/joint1": (0.0, -0.8, 0.0), "right/joint1": (0.0, 0.8, 0.0)}
TIMES = np.array([0.0, 1.0, 2.0])


@pytest.fixture(scope="module")
def clash():
    """A plan of two arms that meet, its verifier and what is proven of it."""
    scene = cell_of()
    rows = np.zeros((len(TIMES), len(scene.q_names)))
    for name, turns in TURNS.items():
        rows[:, scene.q_names.index(name)] = turns
    plan = ag.Plan.of(ag.Trajectory(scene.q_names, rows, TIMES, "clash"), scene)
    verifier = ag.PlanVerifier(scene)
    proof = verifier.verify(plan)
    assert not proof.clear and proof.intervals[0].start > 0.3
    return plan, verifier, proof


def block(low, high):
    """A piece that is a box, from its corners."""
    low, high = np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)
    normals = np.concatenate((np.eye(3), -np.eye(3)))
    return Piece("a/b", 0.0, 1.0, 0.5 * (low + high), normals, np.append(high, -low))


def test_triangles_within_another_piece_are_left_out_and_no_others():
    long, inner = block((0, 0, 0), (4, 1, 1)), block((1, 0.2, 0.2), (2, 0.8, 0.8))
    across, twin = block((3, 0.2, -1), (3.5, 0.8, 2)), block((0, 0, 0), (4, 1, 1))
    beside = block((3.6, 0.5, 0.5), (5, 1.5, 1.5))
    drawn = outside_of([long, inner, across, twin, beside])
    corners = {tuple(corner) for corner in np.round(drawn.triangles.reshape(-1, 3), 9)}
    # The inner one and the twin are hidden; of two others corners or parts are.
    assert len(drawn.faces) == 12 + 12 + 12
    assert corners == {
        tuple(corner)
        for piece in (long, across, beside)
        for corner in np.round(piece.corners, 9)
    }


def test_swept_volumes_have_their_robots_colour_and_clashing_ones_that_of_a_stop(clash):
    plan, verifier, proof = clash
    pieces = verifier.sweep(plan, tolerance=0.05)
    view = PlannedView(verifier.scene, plan, proof, pieces, page_port=0)
    try:
        drawn = [one for one in view.drawables if isinstance(one, SweptVolumes)]
        assert len(drawn) == 2
        for r, (robot, swept) in enumerate(zip(("left", "right"), drawn, strict=True)):
            for (link, clashes), node in swept.nodes.items():
                assert link.startswith(f"{robot}/")
                stop = STATE_COLOURS[State.STOP]
                assert tuple(node.color) == (stop if clashes else ROBOT_TINTS[r])
            near = {link for link, clashes in swept.nodes if clashes}
            pairs = [(one.nearest.a, one.nearest.b) for one in proof.intervals]
            assert near == {a for pair in pairs for a in pair if a.startswith(robot)}
            swept.show(False)
            view._drawn = None
            view.step()
            assert not any(node.visible for node in swept.nodes.values())
        # The time line has a stop where the proof has an interval.
        line = json.loads(view.page.newest["timeline"])
        assert line["length"] == pytest.approx(TIMES[-1])
        first = proof.intervals[0]
        assert line["stops"][0] == pytest.approx(first.start, abs=1.0 / 30.0)
        view.source.stay(1.0)
        frame = view.source.newest
        assert frame.q == pytest.approx(plan.tube.at(np.array([frame.monotonic]))[0])
        assert view.when(frame) == "plan at 1.00 s"
    finally:
        view.close()


def test_pieces_clash_while_their_link_may_be_too_near(clash):
    plan, verifier, proof = clash
    pieces = verifier.sweep(plan, tolerance=0.05)
    found = too_near(pieces, proof)
    times = spans(found)
    for one in proof.intervals:
        for link in (one.nearest.a, one.nearest.b):
            own = [each for each in times if each.link == link]
            assert any(e.start <= one.start and one.end <= e.end for e in own)
    first = min(one.start for one in proof.intervals)
    last = max(one.end for one in proof.intervals)
    assert all(piece.start <= last and piece.end >= first for piece in found)
    assert 0 < len(found) < len(pieces)


def test_a_relative_sweep_moves_with_its_link(clash, tmp_path, monkeypatch):
    shown = []
    monkeypatch.setattr(showing, "show", shown.append)
    rows = np.column_stack((TIMES, *TURNS.values()))
    header = "t," + ",".join(TURNS)
    np.savetxt(tmp_path / "p.csv", rows, delimiter=",", header=header, comments="")
    _, verifier, _ = clash
    monkeypatch.setattr(
        "armguard.cli.verify.load_scene", lambda *_, **__: verifier.scene
    )
    given = ["verify", str(tmp_path / "p.csv"), "--scene", "cell.yaml", "--hold-home"]
    given += ["--view", "--page-port", "0", "--sweep-tolerance", "0.05"]
    found = CliRunner().invoke(app, [*given, "--sweep-relative-to", "left/link2"])
    assert found.exit_code == 1, found.output
    assert "left/link2 meets what right/link2 sweeps in its frame" in found.output
    view = shown[0]
    try:
        [swept] = [one for one in view.drawables if isinstance(one, SweptVolumes)]
        body = view.world.tables.links["left/link2"].body
        names = {node.name for node in swept.nodes.values()}
        assert f"/bodies/{body}/sweep/{slug('right/link2')}_1" in names
        assert all(name.startswith(f"/bodies/{body}/sweep/") for name in names)
    finally:
        view.close()
