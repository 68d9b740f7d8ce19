"""Checks the wheel in dist/: nothing is left to compile or fit; it has the same bits.

make dist-check

Installs it into an environment of its own and plays there and here: here the kernels
are those of this environment, compiled on the spot.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
BUILD = ROOT / "build" / "wheel"
PIP = ("-m", "pip", "install", "--quiet", "--no-deps", "--disable-pip-version-check")

# A guarded bay, two Pandas, gripping, evasion and the service: all ways to stop.
PLAYS = (
    "bay step path",
    "bay deflect",
    "bay evading",
    "pandas deflect",
    "gantry contract",
    "wire twists",
)

# Prints the hash of what every cycle of some plays answers.
PLAY = """
import sys
from hashlib import sha256
sys.path.insert(0, "benchmarks")
from golden_campaign import hashes_of
for name in sys.argv[1:]:
    found = hashes_of(name)
    print(name, sha256(found.cycles.tobytes() + found.blocks.tobytes()).hexdigest())
"""

# Fails if a link is fitted here.
FIT = """
import sys
from armguard.robot import find_named_robot, load_urdf
from armguard.robot.fitting import fit_robot
def fitting(link, *_):
    sys.exit(f"the wheel lacks the fit of {link}")
fit_robot(load_urdf(find_named_robot("panda").urdf), progress=fitting)
"""


def install() -> str:
    """Install the wheel into an empty environment.

    Returns:
        Its Python.
    """
    folder = BUILD / "environment"
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    python = str(folder / "bin" / "python")
    (wheel,) = (ROOT / "dist").glob("armguard-*.whl")
    needed = ("--require-hashes", "-r", str(ROOT / "requirements" / "core.txt"))
    for what in needed, (str(wheel),):
        subprocess.run([python, *PIP, *what], check=True)
    return python


def playing(python: str, **environment: str) -> subprocess.Popen[str]:
    """A process of a Python that answers to the plays."""
    return subprocess.Popen(
        [python, "-c", PLAY, *PLAYS],
        cwd=ROOT,
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        text=True,
    )


def answers(process: subprocess.Popen[str]) -> str:
    """What it answers.

    Raises:
        SystemExit: It failed.
    """
    found, _ = process.communicate()
    if process.returncode:
        sys.exit(f"the plays end with code {process.returncode}")
    return found


def main() -> None:
    """Install, play, compare; the kernels of here are played meanwhile.

    Raises:
        SystemExit: Code was compiled, a robot was fitted, or a play differs.
    """
    cache = BUILD / "empty_cache"
    shutil.rmtree(cache, ignore_errors=True)
    with playing(sys.executable) as here:
        python, away = install(), {"ARMGUARD_CACHE": str(cache), "PYTHONPATH": ""}
        subprocess.run([python, "-c", FIT], env={**os.environ, **away}, check=True)
        with playing(python, **away) as there:
            ready, compiled_here = answers(there), answers(here)
    compiled = [path.name for path in cache.rglob("*.nbc")]
    if compiled:
        sys.exit(f"the wheel lacks code of {len(compiled)} kernels: {compiled}")
    if ready != compiled_here:
        sys.exit("the wheel's code answers otherwise than code compiled here")
    print(f"{len(PLAYS)} plays with the wheel's code, bit for bit as compiled here")


if __name__ == "__main__":
    main()
