"""What passed between a run's controller and its vehicles: messages, and time for decisions."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from minisim.control import TO_VEHICLES, Radio
from minisim.errors import InputError

if TYPE_CHECKING:
    from minisim.results.run import Run


def messages(run: Run) -> int:
    """Messages from vehicles and to them; 0 if the controller has no `radio`."""
    return _sent(run, lambda _: (1, 1))


def message_bytes(run: Run) -> int:
    """The same in bytes."""
    return _sent(run, lambda radio: (radio.state, radio.command))


def _sent(run: Run, sizes: Callable[[Radio], tuple[int, int]]) -> int:
    radio = getattr(run.controller, "radio", None)
    if radio is None:
        return 0
    state, command = sizes(radio)
    if (states := run.counts.get("states_sent")) is not None:  # by `minisim.link`
        return int(states) * state + int(run.counts["orders_sent"]) * command
    told = sum(run.exchange.get(kind.__name__, 0) for kind in TO_VEHICLES)
    return run.exchange.get("shown", 0) * state + told * command


def decision_time(percentile: float) -> Callable[[Run], float | None]:
    """Measures a percentile of the CPU time per decision [µs]; None without a decision."""

    def of(run: Run) -> float | None:
        times = run.decision_times
        if times is None:
            raise InputError("decisions were not timed: simulate with timed=True")
        return float(np.percentile(times, percentile)) * 1e6 if len(times) else None

    return of
