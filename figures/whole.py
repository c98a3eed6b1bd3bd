"""What a picture of a run needs to know, run again if it was not recorded.

A run is run again from its own scenario, controller and seed, at most once (`Run.explained`). That
takes as long as the run did with `record="all"` and `explain=True`: about three times as long as
without. Whoever draws several pictures of a long run had better simulate with both at once.
"""

from __future__ import annotations

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
