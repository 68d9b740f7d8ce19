"""`python -m armguard.simulation`: simulated arms, or one who drives arms.

SIGUSR1 has the one who drives press the button that engages all arms.
"""

import argparse
import signal
import sys
from pathlib import Path
from types import FrameType

from armguard.entry import run_program
from armguard.errors import ArmguardError
from armguard.scene import compile_scene
from armguard.service.client import Client
from armguard.service.server.scenes import open_scene
from armguard.simulation.controller import SimulatedArms
from armguard.simulation.driving import DrivingOperator
from armguard.simulation.operator import Hands, Operator
from armguard.simulation.plant import Imperfection
from armguard.simulation.sway import Sway
from armguard.simulation.tele import TeleDriver

# How long the service gets to answer [s].
PATIENCE = 30.0


def main() -> int:
    """Run until it is ended; an error of ours is one message and exit code 2."""
    words = argparse.ArgumentParser(
        prog="python -m armguard.simulation",
        description=(__doc__ or "").splitlines()[0],
    )
    words.add_argument("--port", type=int, required=True, help="of the service")
    words.add_argument("--key-file", type=Path, help="the service's keys")
    words.add_argument("--scene", help="scene file or bundled scene; the service's")
    words.add_argument("--seed", type=int, default=0, help="of errors of the arms")
    words.add_argument("--errors", type=float, default=0.5, help="share used up [-]")
    words.add_argument("--lateness", type=float, default=0.5, help="the same of delays")
    words.add_argument("--trace", type=Path, help="ring to write the true state into")
    words.add_argument(
        "--drive", type=int, metavar="SEED", help="no arms: drive those that are there"
    )
    words.add_argument(
        "--sway", action="store_true", help="no arms: have those there sway about home"
    )
    asked = words.parse_args()
    ending: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda got, _: ending.append(got))
    try:
        drives = asked.sway or asked.drive is not None
        name = "operator" if drives else "arms"
        with Client(asked.port, keys=asked.key_file, name=name) as client:
            client.connect(timeout=PATIENCE)
            welcome = client.welcome
            what = asked.scene or welcome.scene_file
            scene, _ = open_scene(what, period=welcome.period, late=welcome.period)
            if drives:
                tables = compile_scene(scene)
                hands: Hands = Sway(tables)
                if not asked.sway:
                    hands = Operator(TeleDriver(tables, asked.drive))
                operator = DrivingOperator(client, hands)

                def press(number: int, frame: FrameType | None) -> None:
                    operator.pressed = True

                signal.signal(signal.SIGUSR1, press)
                operator.run(lambda: bool(ending))
                return 0
            how = Imperfection(
                errors=asked.errors, lateness=asked.lateness, seed=asked.seed
            )
            arms = SimulatedArms(client, scene, imperfection=how, trace=asked.trace)
            arms.run(lambda: bool(ending))
            arms.close()
    except ArmguardError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    run_program(main, "simulated arms:")
