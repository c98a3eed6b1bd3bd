"""Human drivers among the vehicles of a run."""

from __future__ import annotations

from dim import Dim, Mixed
from minisim.control import Controller
from minisim.errors import InputError, number


def with_humans(controller: Controller, share: float) -> Controller:
    """The controller with a share of human drivers, 0 … 1; with none it is the controller itself.

    Raises:
        InputError: a share out of range, or humans where the controller is not DIM.
    """
    share = number("share of humans", share, low=0, high=1)
    if share == 0.0:
        return controller
    if not isinstance(controller, Dim):
        raise InputError(
            f"humans drive among vehicles of DIM (dim, dim-harmonious, …), not with "
            f"{controller.name!r}"
        )
    return Mixed(controller, share)
