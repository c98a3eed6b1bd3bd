"""How each vehicle drives: stops, hard braking, jerk, fuel and carbon dioxide.

Each function takes a run recorded with `record="all"`, else it raises `InputError`, and returns one
value per trip, shape (k,).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from minisim.control import HALTING
from minisim.results.emissions import CLASSES, emission_class, rate
from minisim.results.tracks import whole_tracks
from minisim.results.trips import Floats

if TYPE_CHECKING:
    from minisim.results.run import Run

#: A harder deceleration is uncomfortable [m/s²]: most drivers brake up to it on a stop that they
#: see coming (AASHTO, A Policy on Geometric Design of Highways and Streets, 2018, section 3.2.2;
#: Fambro, Fitzpatrick, Koppa 1997, NCHRP Report 400).
COMFORTABLE: Final = 3.4

#: Jerk is averaged over this time [s], as ISO 15622:2018 does for adaptive cruise control.
JERK_TIME: Final = 1.0


def stops(run: Run) -> Floats:
    """How often each vehicle came to a standstill: SUMO's `waitingCount`."""
    tracks = whole_tracks(run)
    return tracks.sums(tracks.begins(tracks.v <= HALTING), len(run.columns.lane))


def hard_brakings(run: Run) -> Floats:
    """How often each vehicle began to brake harder than `COMFORTABLE`."""
    tracks = whole_tracks(run)
    return tracks.sums(tracks.begins(tracks.a < -COMFORTABLE), len(run.columns.lane))


def jerk(run: Run) -> Floats:
    """Largest |a(t) − a(t − 1 s)|/1 s of each vehicle (`JERK_TIME`) [m/s³]; NaN before that."""
    tracks, largest = whole_tracks(run), np.full(len(run.columns.lane), np.nan)
    steps = max(round(JERK_TIME / run.site.dt), 1)
    trip, a = tracks.trip, tracks.a
    same = trip[steps:] == trip[:-steps]
    change = np.abs(a[steps:] - a[:-steps])[same] / (steps * run.site.dt)
    np.fmax.at(largest, trip[steps:][same], change)
    return largest


def fuel(run: Run) -> Floats:
    """Fuel of each vehicle [g], see `minisim.results.emissions`; NaN for a type without a class."""
    return _emitted(run, "fuel")


def co2(run: Run) -> Floats:
    """Carbon dioxide of each vehicle [g], likewise."""
    return _emitted(run, "co2")


def _emitted(run: Run, what: str) -> Floats:
    tracks, mass = whole_tracks(run), np.zeros(len(run.columns.lane))
    for k, name in enumerate(run.site.fleet.names):
        known = emission_class(name)
        if known is None:
            mass[run.columns.type == k] = np.nan
            continue
        here = tracks.type == k
        rates = rate(tracks.v[here], tracks.a[here], getattr(CLASSES[known], what))
        mass += np.bincount(tracks.trip[here], rates, len(mass)) * run.site.dt / 1000.0
    return mass
