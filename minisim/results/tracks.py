"""A recording sorted by vehicle: what measures of single vehicles and of queues are made from."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from minisim.errors import InputError
from minisim.junction.movements import Bools
from minisim.results.trips import Floats, Ints

if TYPE_CHECKING:
    from minisim.results.run import Run


class Tracks(NamedTuple):
    """A recording as arrays, sorted by vehicle, then by time; shape (rows,) each."""

    trip: Ints  #: index among the trips of the run
    tick: Ints
    path: Ints
    type: Ints
    s: Floats
    v: Floats
    a: Floats

    @property
    def first(self) -> Bools:
        """Whether a row is the first of its vehicle."""
        return np.asarray(np.diff(self.trip, prepend=-1) != 0)

    def sums(self, values: Floats | Bools, count: int) -> Floats:
        """The sum of `values` (rows,) over the rows of each of `count` trips."""
        return np.bincount(self.trip, values, count).astype(float)

    def begins(self, state: Bools) -> Bools:
        """Rows in which a vehicle enters a state (rows,); its first row may be one."""
        before = np.concatenate([[False], state[:-1]])
        return np.asarray(state & (self.first | ~before))

    def lasted(self, state: Bools) -> Ints:
        """For how many rows on end each vehicle has been in a state, this one included (rows,)."""
        index = np.arange(len(state))
        out = np.where(state, np.where(self.first, index - 1, -1), index)
        return index - np.maximum.accumulate(out)


def tracks_of(run: Run) -> Tracks:
    """The recording of the trips of a run; raises `InputError` if none was made.

    A row is of the step that ends with it, so SUMO's row of the moment of insertion is left out.
    """
    if run.record is None:
        raise InputError("no trajectories: simulate with record='junction' or record='all'")
    trace, rows, ids, dt = run.trace, run.rows, run.columns.vehicle, run.site.dt
    trip = (rows["id"] - (ids[0] if len(ids) else 0))[trace["row"]]
    own = np.flatnonzero((trip >= 0) & (trip < len(ids)))
    own = own[trace["tick"][own] * dt > run.columns.depart[trip[own]] + dt / 2]
    short = trip[own].astype(np.min_scalar_type(len(ids)))  # numpy sorts 16 bits the fastest
    own = own[np.argsort(short, kind="stable")]  # a recording is sorted by time
    row = trace["row"][own]
    tick, s, v, a = (trace[name][own] for name in ("tick", "s", "v", "a"))
    return Tracks(trip[own], tick, rows["path"][row], rows["type"][row], s, v, a)


def whole_tracks(run: Run) -> Tracks:
    """The same, on all of the road; raises `InputError` if a part was not recorded."""
    if run.record != "all" or not _all_the_time(run):
        raise InputError("not all of each trip was recorded: simulate with record='all'")
    return run.tracks


def _all_the_time(run: Run) -> bool:
    """Whether the recording lasted from the end of the warm-up to the end."""
    since, until = run.record_window
    return since <= float(run.scenario.warmup) and until >= run.columns.end


def entry_times(run: Run) -> Floats:
    """When the front of each vehicle enters the junction [s], shape (k,); infinite if it has not.

    The last step is shared out at its final speed. Raises `InputError` unless all of the time was
    recorded, near the junction at least.
    """
    if run.record is not None and not _all_the_time(run):
        raise InputError("not all of the time was recorded: simulate without record_window")
    tracks, times = run.tracks, np.full(len(run.columns.lane), np.inf)
    past = tracks.s - np.array([path.entry for path in run.site.intersection.paths])[tracks.path]
    inside = np.flatnonzero(past >= 0.0)[::-1]  # so that the first row of a vehicle counts
    with np.errstate(divide="ignore", invalid="ignore"):
        since = np.minimum(np.nan_to_num(past[inside] / tracks.v[inside]), run.site.dt)
    times[tracks.trip[inside]] = tracks.tick[inside] * run.site.dt - since
    return times
