"""`armguard sense` and the options that start the map: what each of them refuses."""

import pytest
from typer.testing import CliRunner

from armguard.cli.app import app
from armguard.errors import NoServiceError, SceneError, StationError
from armguard.processes import free_port
from armguard.scene.bay import bay_path
from armguard.scene.two_pandas import sensed_table_path
from armguard.service.mapping.__main__ import port_of

TABLE = str(sensed_table_path())


def run(*words):
    return CliRunner().invoke(app, list(words))


@pytest.mark.parametrize(
    "words", [(), ("--play", "frames.bin", "--service", "127.0.0.1:47800")]
)
def test_frames_come_from_a_file_or_go_to_a_service(words):
    result = run("sense", TABLE, *words)
    assert result.exit_code == 2
    assert "--play" in result.output and "--service" in result.output


def test_a_port_without_a_service_is_an_error_in_words():
    result = run("sense", TABLE, "--service", f"127.0.0.1:{free_port()}")
    assert isinstance(result.exception, NoServiceError)


@pytest.mark.parametrize(
    "service", ["10.0.0.1:47800", "47800", "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:0"]
)
def test_a_service_on_another_machine_or_no_port_is_refused(service):
    with pytest.raises(StationError, match=r"must be 127\.0\.0\.1:PORT"):
        port_of(service)
    assert port_of("localhost:47800") == port_of("127.0.0.1:47800") == 47800


@pytest.mark.parametrize("option", ["--sense", "--simulated-sensors"])
def test_a_scene_without_sensors_has_no_map(option):
    result = run("serve", str(bay_path()), "--port", "0", option, "--mode", "path")
    assert isinstance(result.exception, SceneError)
    assert "no sensors" in str(result.exception)
