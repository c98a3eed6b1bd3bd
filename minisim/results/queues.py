"""Queues: how long they are over time, by lane, and how fast they discharge."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from minisim.control import HALTING
from minisim.junction.movements import ARM_NAMES, Bools
from minisim.results.tracks import entry_times, whole_tracks
from minisim.results.trips import Floats, Ints
from minisim.ticks import first_tick

if TYPE_CHECKING:
    import pandas as pd

    from minisim.results.run import Run

#: A vehicle slower than this [m/s] for so long [s] is in the queue: SUMO's defaults of
#: `speedThreshold` and `timeThreshold` (page Simulation/Output/Lanearea Detectors).
JAM_SPEED: Final = 5.0 / 3.6
JAM_TIME: Final = 1.0

#: One that has stood stays in the queue up to this speed [m/s], so that it does not leave whenever
#: it moves up. The rule is that of PTV Vissim's queue counters (PTV Vissim 2024, help, "Showing
#: results of queue counters in lists": Begin, End). Their default is said to be 10 km/h; the help
#: that we could read gives no number, and our 10 km/h is twice `JAM_SPEED`.
QUEUE_END: Final = 10.0 / 3.6

#: The first vehicle of a queue with a saturation headway: those before it are still starting up
#: (Highway Capacity Manual, 6th ed., 2016, chapter 31, field measurement of saturation flow rate).
SATURATED: Final = 5


def queue_lengths(run: Run) -> Ints:
    """Vehicles in the queue of each lane after each step since the warm-up, shape (steps, lanes).

    These are the jammed vehicles on the approach (`JAM_SPEED`, `JAM_TIME`), and those that have to
    wait before the road. Raises `InputError` unless run with `record="all"`.
    """
    return np.asarray(_counted(run).sum(axis=2))


def queue_table(run: Run) -> pd.DataFrame:
    """The same as a table, a row per step and lane: `time_s`, `lane`, `on_road`, `before_road`."""
    import pandas as pd

    counts = _counted(run)
    steps, lanes, _ = counts.shape
    start = first_tick(float(run.scenario.warmup), run.site.dt)
    time = np.round((start + np.arange(steps)) * run.site.dt, 6)
    names = pd.Index(list(ARM_NAMES[:lanes]))
    return pd.DataFrame({
        "time_s": np.repeat(time, lanes),
        "lane": pd.Categorical.from_codes(np.tile(np.arange(lanes), steps), names),
        "on_road": counts[..., 0].ravel(), "before_road": counts[..., 1].ravel(),
    })  # fmt: skip


def _counted(run: Run) -> Ints:
    """Vehicles in the queue on the road and before it, shape (steps, lanes, 2)."""
    tracks, trips, dt = whole_tracks(run), run.columns, run.site.dt
    paths, lanes = run.site.intersection.paths, run.site.intersection.n
    start, end = first_tick(float(run.scenario.warmup), dt), round(trips.end / dt) + 1
    coming = tracks.s < np.array([path.entry for path in paths])[tracks.path]
    slow = tracks.lasted((tracks.v < JAM_SPEED) & coming) >= round(JAM_TIME / dt)
    where = tracks.tick[slow] * lanes + trips.lane[tracks.trip[slow]]
    on_road = np.bincount(where, minlength=end * lanes).reshape(end, lanes)
    change = np.zeros((end + 1, lanes), dtype=int)
    came = np.ceil(trips.demand_time / dt - 1e-6).astype(int)
    went = np.where(trips.departed, np.round(np.nan_to_num(trips.depart) / dt).astype(int), end)
    here = came < np.minimum(went, end)
    np.add.at(change, (came[here], trips.lane[here]), 1)
    np.add.at(change, (went[here], trips.lane[here]), -1)
    before = change[:end].cumsum(axis=0)
    return np.stack([on_road, before], axis=-1)[start:]


def queueing(speed: Floats, first: Bools) -> Bools:
    """Whether vehicles stand, or have moved up no faster than `QUEUE_END` since, shape (rows,).

    Rows [m/s] are sorted by vehicle, then by time; `first` are those of new vehicles.
    """
    index, stands = np.arange(len(speed)), speed <= HALTING
    stood = np.maximum.accumulate(np.where(stands, index, -1))
    left = np.maximum.accumulate(np.where((speed > QUEUE_END) | (first & ~stands), index, -1))
    return np.asarray(stood > left)


def saturation_headways(run: Run) -> Floats:
    """Time after the vehicle ahead at which each enters the junction [s], shape (k,).

    Only for vehicles that leave a standing queue as the fifth or later (`SATURATED`); NaN for all
    others. A queue is the vehicles of a lane that stood when the first of them last set off. It
    ends with one that stopped again, or that had not stood. Raises as `queue_lengths`.
    """
    tracks, lane = whole_tracks(run), run.columns.lane
    count, dt = len(lane), run.site.dt
    enters, headway = entry_times(run), np.full(count, np.nan)
    coming = tracks.s < np.array([path.entry for path in run.site.intersection.paths])[tracks.path]
    stood = (tracks.v <= HALTING) & coming
    stopped, left = np.full((2, count), np.nan)
    begun = tracks.begins(stood)
    stopped[tracks.trip[begun]] = tracks.tick[begun] * dt  # rows go on in time: the last one counts
    left[tracks.trip[stood]] = tracks.tick[stood] * dt
    for k in range(run.site.intersection.n):
        place, first, ahead = 0, np.nan, -1
        order = np.flatnonzero((lane == k) & np.isfinite(enters))
        for one in order[np.argsort(enters[order], kind="stable")].tolist():
            place = place + 1 if place and stopped[one] <= first else int(stopped[one] >= 0.0)
            if place == 1:
                first = left[one]
            elif place >= SATURATED:
                headway[one] = enters[one] - enters[ahead]
            ahead = one
    return headway
