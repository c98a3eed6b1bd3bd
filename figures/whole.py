"""What a picture of a run needs to know, run again if it was not recorded.

A run is run again from its own scenario, controller and seed, at most once (`Run.explained`). That
looks for reasons at each step: 15 minutes on four arms at 300 veh/h/lane take 1.3 s of CPU instead
of 0.02 s. A run that was simulated with `record="all"` and `explain=True` is never run again.
"""

from __future__ import annotations

from typing import NamedTuple

from minisim.errors import InputError
from minisim.reasons import Shown, Signalling
from minisim.results.run import Run


def whole(run: Run) -> Run:
    """The run with all of its trajectories from the end of its warm-up on.

    Raises `InputError` for a run in SUMO of which not all was recorded: it is not run again.
    """
    return filmed(run, float(run.scenario.warmup), run.columns.end, everywhere=True)


def filmed(run: Run, first: float, last: float, *, everywhere: bool = False) -> Run:
    """The run with its trajectories from `first` to `last` [s], on all of the road if `everywhere`.

    Raises `InputError` beyond the end of the run, and as `whole`.
    """
    half = run.site.dt / 2.0
    if last > run.columns.end + half:
        raise InputError(
            f"the picture goes to {last:g} s, but the run ended at {run.columns.end:g} s"
        )
    since, until = run.record_window
    kept = run.record == "all" or (run.record == "junction" and not everywhere)
    if kept and since - half <= first and last <= until + half:
        return run
    if run.host["host"] != "minisim":
        raise InputError(
            f"not all of {first:g} … {last:g} s was recorded, and a run in SUMO is not run again: "
            "simulate with record='all'"
        )
    return run.explained.run


def heads(run: Run) -> tuple[Shown, ...]:
    """What signal heads showed, by time; empty without signals, or if SUMO's run kept none."""
    if run.heads is not None or run.host["host"] != "minisim":
        return run.heads or ()
    if not isinstance(run.controller.start(run.site), Signalling):
        return ()
    return run.explained.run.heads or ()


class HeadSpan(NamedTuple):
    """A time during which a lane's head shows one state, from `start` to `end` [s]."""

    lane: int
    state: str
    start: float
    end: float


def head_spans(run: Run) -> list[HeadSpan]:
    """What each signal head showed, and when; empty without signals."""
    since: dict[int, tuple[str, float]] = {}
    spans = []
    for time, lane, state in heads(run):
        if lane in since:
            spans.append(HeadSpan(lane, *since[lane], time))
        since[lane] = state, time
    return spans + [HeadSpan(lane, *known, run.columns.end) for lane, known in since.items()]
