"""`Run`, the result of a run on any host."""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np

from minisim.arrivals import Arrivals
from minisim.control import Command, Controller, Plan, Site
from minisim.engine.collision import Collision
from minisim.engine.state import Records
from minisim.errors import InputError
from minisim.junction.movements import ARM_NAMES
from minisim.names import name_of
from minisim.reasons import Reason, Shown, Told
from minisim.results.asked import Asked
from minisim.results.summary import summarise, trip_table
from minisim.results.tracks import Tracks, tracks_of
from minisim.results.trajectories import TRAJECTORY_COLUMNS, TYPE
from minisim.results.trips import Columns, Floats, Trips
from minisim.ticks import first_tick
from minisim.version import __version__

if TYPE_CHECKING:
    import pandas as pd

    from minisim.results.encounters import Encounters
    from minisim.results.why import Account


#: A step, and the commands given from outside then.
Given: TypeAlias = tuple[int, tuple[Command, ...]]


class ScenarioLike(Protocol):
    """What a run needs from a scenario, such as `scenarios.Scenario`."""

    @property
    def name(self) -> str:
        """Such as "four-way"."""

    @property
    def profile_name(self) -> str:
        """Such as "paper"."""

    @property
    def density(self) -> float:
        """Mean inflow per lane [veh/h]."""

    @property
    def horizon(self) -> float:
        """Simulated time [s]."""

    @property
    def warmup(self) -> float:
        """Nothing before this time [s] is measured; only collisions always count."""

    @property
    def depart_speed(self) -> float | None:
        """Highest speed at insertion [m/s]; None means the highest safe one."""

    def site(self, seed: int) -> Site:
        """What the controller may know."""

    def arrivals(self, seed: int) -> Arrivals:
        """The arrival table."""


@cache
def environment() -> Mapping[str, str]:
    """The versions used for runs in this process, for their provenance."""
    python, numpy = platform.python_version(), np.__version__
    return {"minisim": __version__, "python": python, "numpy": numpy}


@dataclass(frozen=True, eq=False)
class Run:
    """The result of a run."""

    scenario: ScenarioLike
    controller: Controller
    seed: int
    site: Site  #: what the controller knew
    plan: Plan  #: what the controller asked for
    collisions: tuple[Collision, ...]  #: each pair of vehicles once
    columns: Trips  #: all trips as arrays, those of the warm-up too
    record: str | None  #: what was recorded of the trajectories: "junction", "all" or None
    trace: Records  #: the recording
    rows: Records  #: vehicle id, path and type of each row to which the trace refers
    #: What the controller's session has counted since the warm-up.
    counts: Mapping[str, float] = field(default_factory=dict)
    #: How often the controller decided since the warm-up (`decisions`), how many vehicles it was
    #: `shown` then in all, and its commands by class, such as `Go`.
    exchange: Mapping[str, int] = field(default_factory=dict)
    #: CPU time of each of these decisions [s], shape (decisions,); None unless `timed`. Not saved.
    decision_times: Floats | None = None
    #: First and last time of the recording [s]; the run may have ended earlier.
    record_window: tuple[float, float] = (0.0, math.inf)
    kinds: tuple[str, ...] = ()  #: kind of each vehicle by id; empty if all are of one kind
    reasons: tuple[Told, ...] | None = None  #: why vehicles waited, by time; None unless `explain`
    heads: tuple[Shown, ...] | None = None  #: what signal heads showed, by time; None likewise
    given: tuple[Given, ...] = ()  #: commands from outside, by step
    #: What moved the vehicles, for the provenance: the `host` and perhaps its version.
    host: Mapping[str, str] = field(default_factory=lambda: {"host": "minisim"})
    environment: Mapping[str, str] = field(default_factory=environment)

    @cached_property
    def trips(self) -> pd.DataFrame:
        """One row per trip that counts, in demand order; columns `summary.TRIP_COLUMNS`."""
        return trip_table(self.counted.columns, self.counted.kinds, self.site.fleet.names)

    @cached_property
    def counted(self) -> Run:
        """The part of the run that metrics measure: trips and trajectories after the warm-up."""
        start = float(self.scenario.warmup)
        rows = self.columns.counted(start)
        if self.columns.start == start and rows == slice(0, len(self.columns.lane)):
            return self
        return replace(
            self,
            columns=self.columns.taken(rows)._replace(start=start),
            kinds=self.kinds[rows],
            trace=self.trace[self.trace["tick"] >= first_tick(start, self.site.dt)],
        )

    @cached_property
    def tracks(self) -> Tracks:
        """The recording of its trips, sorted by vehicle; `InputError` if there is none."""
        return tracks_of(self)

    @cached_property
    def safety(self) -> Mapping[str, float | int | None]:
        """The closest calls in and near the junction; see `minisim.results.safety`."""
        from minisim.results.safety import summary_of

        return summary_of(self.counted.encounters)

    @cached_property
    def encounters(self) -> Encounters:
        """Each encounter of two vehicles in and near the junction; `InputError` if not recorded."""
        from minisim.results.encounters import encounters_of

        return encounters_of(self)

    def why(self, vehicle: int, time: float) -> Reason:
        """Why a vehicle did what it did at a time [s].

        A run without reasons, or without all trajectories, is run again for the first question
        (`explained`), which takes about as long as the run did with `explain=True`.

        Raises `InputError` for a vehicle or a time that the run does not have, and for a run that
        cannot be run again: one in SUMO, or a saved one whose classes are not ours.
        """
        return self.explained.why(vehicle, time)

    @cached_property
    def explained(self) -> Account:
        """The reasons of all vehicles at all times; see `why` for its cost and errors."""
        from minisim.results.why import account_of

        return account_of(self)

    def summary(
        self, metrics: str | Iterable[Asked] = (), by: Iterable[str] = ()
    ) -> dict[str, Any]:
        """What was run, and the numbers; see `minisim.results.summary.summarise`."""
        what = self.scenario
        return {
            "controller": name_of(self.controller), "scenario": what.name,
            "profile": what.profile_name, "fleet": str(self.site.fleet), "density": what.density,
            "seed": self.seed,
            "horizon_s": what.horizon, "warmup_s": what.warmup, "host": self.host["host"],
            **summarise(self, metrics, by),
        }  # fmt: skip

    @property
    def provenance(self) -> dict[str, str]:
        """Versions and parameters: everything needed to run it again."""
        what = {"scenario": repr(self.scenario), "controller": repr(self.controller)}
        return {**self.environment, **what, "seed": str(self.seed), **self.host}

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the run to one file; see `minisim.results.saved`.

        Raises `MissingExtraError` without pyarrow, `InputError` for a site not made of our own
        classes, and `FileError` if the file cannot be written; then nothing is left behind.
        """
        from minisim.results.saved import save

        save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Run:
        """Read a run that `save` has written.

        Raises `MissingExtraError` without pyarrow, and `FileError` if the file is missing or
        damaged, not a saved run, or of another layout.
        """
        from minisim.results.saved import load

        return load(path)

    def __repr__(self) -> str:
        from minisim.results.show import as_text

        return as_text(self)

    def _repr_html_(self) -> str:
        from minisim.results.show import as_html

        return as_html(self)

    def recorded(self, before: float = math.inf, past: float = math.inf) -> tuple[Columns, Columns]:
        """The columns of `trace`, by time, then vehicle, and of `rows` for each of its lines.

        Fronts from `before` ahead of the junction to `past` behind it [m]. Raises `InputError` if
        nothing was recorded.
        """
        if self.record is None:
            raise InputError("no trajectories: simulate with record='junction' or record='all'")
        trace, rows, paths = self.trace, self.rows, self.site.intersection.paths
        row, s = trace["row"], trace["s"]
        last = np.array([path.exit for path in paths])[rows["path"]] + past
        here = np.flatnonzero((s >= paths[0].entry - before) & (s <= last[row]))
        key = trace["tick"][here] * (1 + rows["id"].max(initial=0)) + rows["id"][row[here]]
        order = here[np.argsort(key, kind="stable")]
        row = row[order]
        lines = {name: trace[name][order] for name in ("tick", "s", "v", "a", "released")}
        return lines, {name: rows[name][row] for name in ("id", "path", "type")}

    @cached_property
    def trajectories(self) -> pd.DataFrame:
        """One row per vehicle and step, the warm-up's too; `InputError` if not recorded."""
        import pandas as pd

        trace, rows = self.recorded()
        intersection, types = self.site.intersection, self.site.types
        movements, path_of = intersection.movements, rows["path"]
        front, heading = np.zeros((2, len(path_of), 2))
        pairs = np.unique(np.stack([path_of, rows["type"]], axis=-1), axis=0)
        for p, kind in pairs.tolist():
            here = (path_of == p) & (rows["type"] == kind)
            front[here] = intersection.paths[p].position(trace["s"][here])
            heading[here] = intersection.paths[p].pose(trace["s"][here], types[kind])[1]
        lanes = pd.Index(list(ARM_NAMES[: intersection.n]))
        columns = (
            np.round(trace["tick"] * self.site.dt, 6), rows["id"],
            pd.Categorical.from_codes(movements.origins[path_of], lanes),
            movements.manoeuvres[path_of], trace["s"], *front.T,
            np.degrees(np.arctan2(*heading.T)) % 360.0, trace["v"], trace["a"],
            trace["released"] != 0,
        )  # fmt: skip
        frame = pd.DataFrame(dict(zip(TRAJECTORY_COLUMNS, columns, strict=True)))
        if len(types) > 1:
            names = pd.Index(self.site.fleet.names)
            frame.insert(2, TYPE, pd.Series(pd.Categorical.from_codes(rows["type"], names)))
        return frame
