"""`armguard view`: the live view of a service, or of a recording."""

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from armguard.cli.console import say
from armguard.errors import StationError


def view(
    recording: Annotated[
        Path | None,
        Argument(help="Recording to play; the running service if left out."),
    ] = None,
    port: Annotated[int, Option(help="Port of the service.")] = 47800,
    page_port: Annotated[
        int, Option(help="Port of the page; 0 for a free one.")
    ] = 8080,
    key_file: Annotated[Path | None, Option(help="Key file of the service.")] = None,
) -> None:
    """Show a running service or a recording in the browser.

    The robots of a running service can be driven there.

    The first line on standard output has a link, valid for one browser. After its use
    the next line has a link for another browser.
    """
    if find_spec("viser") is None:
        raise StationError("the view needs viser: pip install 'armguard[view]'")
    from armguard.view.__main__ import show

    if recording is None:
        from armguard.view.live_view import LiveView

        show(LiveView(port, page_port, keys=key_file))
        return
    from armguard.recording import open_recording
    from armguard.view.recorded_view import RecordedView

    found = open_recording(recording)
    shown = RecordedView(found.scene(), found.frames(), page_port)
    for problem in found.problems:
        say(f"note: {problem}")
    show(shown)
