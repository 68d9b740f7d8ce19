"""The period at which a scene file is served."""

import pytest

from armguard.cli.serve import Options
from armguard.errors import ServiceError
from armguard.scene.bay import bay_path

ARM = f"robots: {{arm: {{urdf: {bay_path().parent / 'bay_arm.urdf'}}}}}\n"


@pytest.mark.parametrize(
    ("cycle", "given", "rate", "late"),
    [
        ("", {}, 250.0, 0.004),
        ("cycle: {period: 0.02}\n", {}, 50.0, 0.004),
        ("cycle: {period: 0.02, late: 0.01}\n", {}, 50.0, 0.01),
        ("cycle: {late: 0.001}\n", {}, 250.0, 0.001),
        ("cycle: {period: 0.02, late: 0.01}\n", {"rate": 100.0}, 100.0, 0.01),
        ("cycle: {period: 0.02, late: 0.01}\n", {"late": 0.002}, 50.0, 0.002),
    ],
)
def test_the_scene_states_the_rate_unless_an_option_does(
    tmp_path, cycle, given, rate, late
):
    file = tmp_path / "scene.yaml"
    file.write_text(cycle + ARM, encoding="utf-8")
    settings = Options(scene=str(file), **given).settings()
    assert settings.rate == pytest.approx(rate)
    assert settings.late == late


def test_a_bundled_scene_has_the_usual_rate():
    assert Options(scene="bay").settings().rate == 250.0


def test_a_period_that_no_service_keeps_is_refused(tmp_path):
    file = tmp_path / "scene.yaml"
    file.write_text("cycle: {period: 0.0001}\n" + ARM, encoding="utf-8")
    with pytest.raises(ServiceError, match="rate is 10000"):
        Options(scene=str(file)).settings()
