"""Callbacks and questions that the tabs of the panel share."""

from collections.abc import Callable
from typing import Any

import viser


def by_page(does: Callable[[viser.GuiEvent], object]) -> Callable[[Any], None]:
    """A callback for changes that a person makes on a page, not the view itself."""

    def call(event: viser.GuiEvent) -> None:
        if event.client is not None:
            does(event)

    return call


def ask(
    event: viser.GuiEvent,
    title: str,
    add: Callable[[Any], object],
    yes: tuple[str, str],
    no: str,
    does: Callable[[viser.GuiEvent], object],
) -> None:
    """Ask the person who caused an event, and do something if the answer is yes.

    Args:
        event: The event.
        title: Title of the question.
        add: Adds the question to the page.
        yes: Text and colour of the button that agrees.
        no: Text of the other button.
        does: Called with the event of the button that agrees.
    """
    if event.client is None:
        return
    gui = event.client.gui
    with gui.add_modal(title) as modal:
        add(gui)
        agree = gui.add_button(yes[0], color=yes[1])
        refuse = gui.add_button(no)
    agree.on_click(lambda answer: (modal.close(), does(answer)))
    refuse.on_click(lambda _: modal.close())
