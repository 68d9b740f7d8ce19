"""A cell with an arm of two joints and a ball, in a folder of its files."""

import os

import pytest
from typer.testing import CliRunner

from armguard.cli.app import app

SCENE = """
mode: fixed
buffer: 0.02
robots:
  arm: {urdf: arm.urdf, home: {turn: -1.0, bend: 0.0}}
objects:
  ball: {sphere: {radius: 0.1}, at: {xyz: [0.5, 0.45, 0]}}
"""

# The tip passes the base where the arm bends back.
ARM = """<robot name="r">
 <link name="base"><collision><geometry><sphere radius="0.05"/></geometry></collision>
 </link>
 <link name="rod"><collision><origin xyz="0.3 0 0"/>
  <geometry><sphere radius="0.05"/></geometry></collision></link>
 <link name="tip"><collision><origin xyz="0.33 0 0"/>
  <geometry><sphere radius="0.05"/></geometry></collision></link>
 <joint name="turn" type="revolute"><parent link="base"/><child link="rod"/>
  <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="2"/></joint>
 <joint name="bend" type="revolute"><parent link="rod"/><child link="tip"/>
  <origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>
  <limit lower="-3" upper="3" effort="1" velocity="2"/></joint>
</robot>"""


STOPPING = """
    response: stop
    stopping:
      acceleration: 10
      deceleration: 5
      errors: {position: 0.001, velocity: 0.01}
      delays: {sensing: 0.004, command: 0.008, stale: 0.02}
"""


@pytest.fixture
def cell(tmp_path, monkeypatch):
    """The folder, in which the test is."""
    (tmp_path / "arm.urdf").write_text(ARM)
    (tmp_path / "cell.yaml").write_text(SCENE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def moving():
    """Its scene as text, without a buffer, with an arm that stops as declared."""
    text = SCENE.replace(
        "mode: fixed", "mode: path\ncycle: {period: 0.008, late: 0.002}"
    )
    text = text.replace("buffer: 0.02", "buffer: 0")
    text = text.replace("{urdf: arm.urdf,", f"\n    urdf: arm.urdf{STOPPING}   ")
    return text.replace("bend: 0.0}}", "bend: 0.0}")


@pytest.fixture
def fleet():
    """Calls `armguard fleet`, and gives the code and all that it printed."""

    def call(*words):
        found = CliRunner().invoke(app, ["fleet", *map(str, words)])
        said = f"{found.output}{'' if found.exception is None else found.exception}"
        return found.exit_code, said

    return call


@pytest.fixture
def poisoned(tmp_path_factory, monkeypatch):
    """In processes that start from now on, opening some files has no good end.

    One whose name has `kills` ends its process, and with `hangs` it never returns.
    """
    folder = tmp_path_factory.mktemp("poison")
    (folder / "sitecustomize.py").write_text(
        "import os, signal, sys, time\n"
        "def hook(event, given):\n"
        "    if event == 'open' and 'kills' in str(given[0]):\n"
        "        os.kill(os.getpid(), signal.SIGSEGV)\n"
        "    if event == 'open' and 'hangs' in str(given[0]):\n"
        "        time.sleep(1e6)\n"
        "sys.addaudithook(hook)\n"
    )
    before = os.environ.get("PYTHONPATH", "")
    monkeypatch.setenv("PYTHONPATH", f"{folder}{os.pathsep}{before}")
