"""Why a vehicle did what it did: what was written down, and what its place in the lane tells."""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING, Any

import numpy as np

from minisim.errors import InputError, integer, number
from minisim.reasons import Reason, Told
from minisim.ticks import first_tick

if TYPE_CHECKING:
    from minisim.results.run import Run
    from minisim.stepping import Stepped

#: A time may be off by this much through rounding [s].
ROUNDING = 1e-6


class Account:
    """The reasons of a run by vehicle and time; `told` is what was written down, by vehicle."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.told: dict[int, list[Told]] = {}
        for told in run.reasons or ():
            self.told.setdefault(told.reason.vehicle, []).append(told)
        trace, rows = run.recorded()
        entry = run.site.intersection.approach_length
        lanes = run.site.intersection.movements.origins[rows["path"]]
        before = np.flatnonzero(trace["s"] < entry)
        order = before[np.lexsort((-trace["s"][before], lanes[before], trace["tick"][before]))]
        self._tick, self._lane = trace["tick"][order], lanes[order]
        self._vehicle = rows["id"][order]

    def why(self, vehicle: int, time: float) -> Reason:
        """See `Run.why`."""
        trips, dt = self.run.columns, self.run.site.dt
        if not len(trips.vehicle):
            raise InputError("the run has no vehicles, so none waits")
        integer("vehicle", vehicle, low=0, high=len(trips.vehicle) - 1)
        number("time [s]", time, low=0, high=trips.end)
        comes, departs = float(trips.demand_time[vehicle]), float(trips.depart[vehicle])
        arrives = float(trips.arrival[vehicle])
        if time < comes:
            return Reason("not there", vehicle, note=f"it comes at {comes:.1f} s", until=comes)
        if not time >= departs:  # also if it has never departed
            return Reason("no room", vehicle, since=comes)
        if time >= arrives:
            return Reason("not there", vehicle, note=f"it left the road at {arrives:.1f} s")
        told = self.told.get(vehicle, [])
        k = bisect_right(told, time + ROUNDING, key=lambda it: it.time) - 1
        if k >= 0:
            return told[k].reason
        ahead = self.ahead(vehicle, first_tick(time, dt))
        return Reason("free", vehicle) if ahead is None else Reason("behind", vehicle, (ahead,))

    def chain(self, vehicle: int, time: float) -> list[Reason]:
        """The reason, and if that is a vehicle ahead in the lane, its reason, and so on."""
        chain = [self.why(vehicle, time)]
        while chain[-1].kind == "behind":
            chain.append(self.why(chain[-1].vehicles[0], time))
        return chain

    def ahead(self, vehicle: int, tick: int) -> int | None:
        """The vehicle ahead on the approach of its lane at a step, if any."""
        first, last = self._tick.searchsorted((tick, tick + 1)).tolist()
        found = np.flatnonzero(self._vehicle[first:last] == vehicle)
        if not len(found) or not found[0]:
            return None
        k = first + int(found[0])
        return int(self._vehicle[k - 1]) if self._lane[k] == self._lane[k - 1] else None


def account_of(run: Run) -> Account:
    """The account of a run, which is run again if it was not recorded; see `Run.why`."""
    since, until = run.record_window
    whole = run.record == "all" and since == 0.0 and until >= run.columns.end
    if run.reasons is not None and whole:
        return Account(run)
    from minisim.stepping import repeated

    with _again(run) as again:
        return Account(repeated(again, run.given, run.columns.end))


def _again(run: Run) -> Stepped:
    """A run that has yet to be made again, in the same host, so that it says why."""
    options: dict[str, Any] = {"record": "all", "explain": True, "on_collision": "record"}
    if run.host["host"] == "sumo":
        from minisim.sumo import Simulation as Sumo

        options["model"] = run.host["sumo_model"]
        return Sumo(run.scenario, run.controller, seed=run.seed, **options)
    from minisim.simulation import Simulation

    return Simulation(run.scenario, run.controller, seed=run.seed, **options)
