"""Controls of the panel that call a function, and questions."""

from collections.abc import Callable
from typing import Any

import viser


def on_click(button: Any, does: Callable[[], object]) -> Any:
    """Have a button call a function; the button."""
    button.on_click(lambda _: does())
    return button


def on_value(control: Any, does: Callable[[Any], object]) -> Any:
    """Have a control call a function with every new value; the control."""
    control.on_update(lambda _: does(control.value))
    return control


def on_page(control: Any, does: Callable[[viser.GuiEvent], object]) -> Any:
    """Have a control call a function when a person, not the view, sets it."""

    @control.on_update
    def _(event: viser.GuiEvent) -> None:
        if event.client is not None:
            does(event)

    return control


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
        on_click(gui.add_button(no), modal.close)
    agree.on_click(lambda answer: (modal.close(), does(answer)))
