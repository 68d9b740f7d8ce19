"""The sampled proposal: right about what is certain, never applied."""

from armguard.scene import Scene, compile_scene
from armguard.scene.allowed import allowed_pairs
from armguard.scene.proposal import propose_allowed


def test_pairs_of_one_robot_are_proposed_and_nothing_changes():
    scene = Scene(mode="fixed")
    scene.add_robot("ur5", name="arm")
    before = len(allowed_pairs(scene))
    tables = compile_scene(scene)
    found = propose_allowed(tables, samples=300)
    assert all(p.kind in ("always", "never") for p in found)
    assert all(p.least <= p.greatest for p in found)
    assert len(allowed_pairs(scene)) == before
    assert propose_allowed(tables, samples=300) == found
    for p in found:
        assert p.yaml.startswith("- {a: arm/")
        assert "300 sampled configurations" in p.yaml
