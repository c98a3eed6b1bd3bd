"""Runs in which vehicles misread each other: how to ask for them, and what is counted."""

from __future__ import annotations

from dataclasses import replace

from dim import Dim, Perception
from dim.tally import Tallied
from minisim.control import Controller
from minisim.errors import InputError


def with_perception(controller: Controller, perception: Perception) -> Controller:
    """The controller, but its vehicles see like this; exact perception leaves it as it is.

    Raises:
        InputError: senses that err where the controller is not DIM.
    """
    if perception.period is None:
        return controller
    if not isinstance(controller, Dim):
        raise InputError(
            f"vehicles of DIM (dim, dim-harmonious, …) can misread each other, not those of "
            f"{controller.name!r}"
        )
    return replace(controller, perception=perception)


def counted(controller: Controller) -> Controller:
    """The controller with a tally of its errors (`dim.tally`), where its vehicles' senses err."""
    if isinstance(controller, Dim) and controller.perception.period is not None:
        return Tallied(controller)
    return controller
