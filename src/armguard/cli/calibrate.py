"""`armguard sense calibrate`: the pose and the delay of a sensor from postures."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from typer import Option

from armguard.cli.console import CLEAR, Json, SceneFile, loading_bar, out, print_json
from armguard.errors import SceneError
from armguard.recording.sensor_files import sensor_source
from armguard.scene import Scene, load_scene
from armguard.scene.file_edit import difference, write_checked
from armguard.scene.sensor_edit import with_sensor
from armguard.sense.calibration import POSTURES, Calibrated, calibrated
from armguard.sense.postures import calibration_postures


def calibrate(
    scene: SceneFile,
    sensor: Annotated[str, Option(help="Name of the sensor, or of the ring.")],
    plan: Annotated[
        Path | None,
        Option(help="Write postures that the guard allows to this CSV file, and end."),
    ] = None,
    play: Annotated[
        Path | None,
        Option(help="Frames at these postures and between them: a file as of --play."),
    ] = None,
    postures: Annotated[
        int, Option(help="How many postures.", min=POSTURES, max=200)
    ] = POSTURES,
    write: Annotated[
        bool, Option("--write", help="Write the corrected pose into the scene file.")
    ] = False,
    json: Json = False,
) -> None:
    """Find pose and delay of a sensor by what it sees of links and objects.

    First `--plan FILE`: postures on straight lines of joint positions that the guard
    allows. Move the arms through them by way of the guard, and record the frames. Then
    `--play FILE`: the answer is the difference of the scene file.

    Exit codes: 0 the pose is found, 2 the postures do not determine it, or a file
    cannot be read.
    """
    if (plan is None) == (play is None):
        raise SceneError("give --plan FILE for postures, or --play FILE for the pose")
    with loading_bar() as progress:
        loaded = load_scene(scene, progress=progress)
    if plan is not None:
        path = calibration_postures(loaded, sensor, postures)
        write_postures(plan, loaded, path)
        out.print(f"{len(path)} postures from home on in {plan}")
        raise typer.Exit(CLEAR)
    assert play is not None
    found = calibrated(loaded, sensor, sensor_source(play, loaded).events)
    before = scene.read_text(encoding="utf-8")
    after = with_sensor(before, sensor, found.pose, found.delay)
    if write:
        write_checked(scene, before, after)
    if json:
        print_json(plain(found) | {"written": write})
    else:
        out.print(in_words(sensor, found))
        out.print(difference(before, after, scene.name), markup=False)
    raise typer.Exit(CLEAR)


def write_postures(path: Path, scene: Scene, rows: NDArray[np.float64]) -> None:
    """Write joint positions with the names of the joints.

    Raises:
        SceneError: The file cannot be written.
    """
    header = ",".join(scene.q_names)
    try:
        np.savetxt(
            path, rows, "%.6f", ",", header=header, comments="", encoding="utf-8"
        )
    except OSError as error:
        raise SceneError(f"'{path}' cannot be written: {error.strerror}") from None


def in_words(sensor: str, found: Calibrated) -> str:
    """A result as a sentence."""
    sigma = 3.0 * found.sigma
    late = (
        "its delay is not determined: the arms did not move"
        if found.delay is None
        else f"its delay is {found.delay * 1e3:.1f} ± {sigma[6] * 1e3:.1f} ms"
    )
    return (
        f"{sensor} is {found.shift * 1e3:.1f} ± {max(sigma[:3]) * 1e3:.1f} mm and "
        f"{np.degrees(found.turn):.2f} ± {np.degrees(max(sigma[3:6])):.2f}° from its "
        f"declared pose (3 standard deviations, {found.used} distances); {late}"
    )


def plain(found: Calibrated) -> dict[str, Any]:
    """A result as plain values, in m, rad and s."""
    return {
        **found._asdict(),
        "pose": asdict(found.pose),
        "sigma": found.sigma.tolist(),
    }
