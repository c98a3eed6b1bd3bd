"""Runs in which vehicles misread each other: how to ask for them, and what is counted."""

from __future__ import annotations

from dataclasses import replace

from dim import Dim, Perception
from dim.senses.tally import Tallied
from minisim.control import Controller
from minisim.errors import InputError


def with_perception(controller: Controller, perception: Perception) -> Controller:
    """The controller, but its vehicles see like this; exact perception leaves it as it is.

    Raises:
        InputError: senses that err where the controller is not DIM, or has some already.
    """
    if perception.period is None:
        return controller
    if not isinstance(controller, Dim):
        raise InputError(
            f"vehicles of DIM (dim with any parameters, in profiles other than as_run) can misread "
            f"each other, not those of {controller.name!r}"
        )
    if controller.perception.period is not None:
        raise InputError(
            f"{controller.name!r} has a perception of its own; misread intents go with those that "
            "have none, such as dim or dim:monitor=on"
        )
    return replace(controller, perception=perception)


def counted(controller: Controller) -> Controller:
    """The controller with a tally of its errors (`dim.senses.tally`), where its senses err."""
    if isinstance(controller, Dim) and controller.perception.period is not None:
        return Tallied(controller)
    return controller
