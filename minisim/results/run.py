"""`Run`, the result of a run on any host."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from minisim.arrivals import Arrivals
from minisim.control import (
    Controller,
    Plan,
    Site,
)
from minisim.engine.collision import Collision
from minisim.engine.state import (
    Records,
)
from minisim.errors import (
    InputError,
)
from minisim.results.metrics import Metric
from minisim.results.summary import summarise, trip_table
from minisim.results.trajectories import TRAJECTORY_COLUMNS
from minisim.results.trips import Trips
from minisim.version import __version__

if TYPE_CHECKING:
    import pandas as pd


class ScenarioLike(Protocol):
    """What a run needs of a scenario (`scenarios.Scenario` is one)."""

    @property
    def name(self) -> str:
        """Such as "four-way"."""

    @property
    def profile_name(self) -> str:
        """Such as "paper"."""

    @property
    def density(self) -> float:
        """Mean inflow a lane [veh/h]."""

    @property
    def horizon(self) -> float:
        """Simulated time [s]."""

    @property
    def warmup(self) -> float:
        """Trips demanded before it do not count in any mean or number of trips [s]."""

    @property
    def depart_speed(self) -> float | None:
        """At insertion [m/s]; None is the highest safe one."""

    def site(self, seed: int) -> Site:
        """What the controller may know."""

    def arrivals(self, seed: int) -> Arrivals:
        """The arrival table."""


@cache
def environment() -> Mapping[str, str]:
    """What a run of now is made with, for its provenance."""
    return {
        "minisim": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


@dataclass(frozen=True, eq=False)
class Run:
    """The result of a run.

    Attributes:
        scenario, controller, seed: what was run.
        site, plan: what the controller knew and asked for.
        collisions: each pair of vehicles once.
        columns: all trips as arrays.
        record: what was recorded of the trajectories.
        trace, rows: the recording, and each row's vehicle id and path.
        counts: what the controller's session counted.
        kinds: of the vehicles, by id, where they are of several kinds.
        host: what moved the vehicles, for the provenance: `host` and what else to name.
        environment: versions, for the provenance.
    """

    scenario: ScenarioLike
    controller: Controller
    seed: int
    site: Site
    plan: Plan
    collisions: tuple[Collision, ...]
    columns: Trips
    record: str | None
    trace: Records
    rows: Records
    counts: Mapping[str, float] = field(default_factory=dict)
    kinds: tuple[str, ...] = ()
    host: Mapping[str, str] = field(default_factory=lambda: {"host": "minisim"})
    environment: Mapping[str, str] = field(default_factory=environment)

    @cached_property
    def trips(self) -> pd.DataFrame:
        """One row a trip in demand order, columns `minisim.results.summary.TRIP_COLUMNS`."""
        return trip_table(self.columns, self.kinds)

    @cached_property
    def counted_rows(self) -> slice:
        """Indices of the trips that count: demanded after the warm-up, up to the end."""
        return self.columns.counted(self.scenario.warmup)

    @cached_property
    def counted(self) -> Trips:
        """The trips that count; every mean and number of trips is of them."""
        rows, start = self.counted_rows, float(self.scenario.warmup)
        if start == 0.0 and rows == slice(0, len(self.columns.lane)):
            return self.columns
        return self.columns.taken(rows)._replace(start=start)

    @cached_property
    def safety(self) -> Mapping[str, float | int | None]:
        """The closest calls (`minisim.results.safety.safety_summary`).

        They are those in and near the junction, whatever else was recorded.
        """
        from minisim.results.safety import near_junction, safety_summary

        frame = self.trajectories
        near = frame if self.record == "junction" else near_junction(frame, self.site)
        return safety_summary(near, self.site)

    def summary(
        self, metrics: Iterable[str | Metric] = (), by: Iterable[str] = ()
    ) -> dict[str, Any]:
        """What was run and its numbers; see `minisim.results.summary.summarise`."""
        return {
            "controller": self.controller.name,
            "scenario": self.scenario.name,
            "profile": self.scenario.profile_name,
            "density": self.scenario.density,
            "seed": self.seed,
            "horizon_s": self.scenario.horizon,
            "warmup_s": self.scenario.warmup,
            "host": self.host["host"],
            **summarise(self, metrics, by),
        }

    @property
    def provenance(self) -> dict[str, str]:
        """Version, environment and parameters: all that is needed to run it again."""
        return {
            **self.environment,
            "scenario": repr(self.scenario),
            "controller": repr(self.controller),
            "seed": str(self.seed),
            **self.host,
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the run to one file; see `minisim.results.saved`.

        Raises:
            MissingExtraError: pyarrow is not installed.
            InputError: a site that is not made of our classes.
            FileError: the file cannot be written; nothing is left behind.
        """
        from minisim.results.saved import save

        save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Run:
        """Read a run that `save` has written.

        Raises:
            MissingExtraError: pyarrow is not installed.
            FileError: no such file, no saved run, a damaged one, or one of a newer version.
        """
        from minisim.results.saved import load

        return load(path)

    def __repr__(self) -> str:
        from minisim.results.show import as_text

        return as_text(self)

    def _repr_html_(self) -> str:
        from minisim.results.show import as_html

        return as_html(self)

    @cached_property
    def trajectories(self) -> pd.DataFrame:
        """One row a vehicle and step, columns `minisim.results.trajectories.TRAJECTORY_COLUMNS`.

        Raises:
            InputError: nothing was recorded.
        """
        import pandas as pd

        if self.record is None:
            raise InputError("no trajectories: simulate with record='junction' or record='all'")
        vehicle = self.rows["id"][self.trace["row"]]
        order = np.lexsort((vehicle, self.trace["tick"]))
        trace, vehicle = self.trace[order], vehicle[order]
        paths, arms = self.site.intersection.paths, self.site.intersection.arms
        path_of = self.rows["path"][trace["row"]]
        front = np.zeros((len(trace), 2))
        heading = np.zeros((len(trace), 2))
        for p in np.unique(path_of).tolist():
            chosen = np.flatnonzero(path_of == p)
            s = trace["s"][chosen]
            front[chosen] = paths[p].position(s)
            heading[chosen] = paths[p].pose(s, self.site.vehicle.length)[1]
        movements = self.site.intersection.movements
        columns = (
            np.round(trace["tick"] * self.site.dt, 6),
            vehicle,
            pd.Categorical.from_codes(
                movements.origins[path_of], pd.Index([arm.name for arm in arms])
            ),
            movements.manoeuvres[path_of],
            trace["s"],
            front[:, 0],
            front[:, 1],
            np.degrees(np.arctan2(heading[:, 0], heading[:, 1])) % 360.0,
            trace["v"],
            trace["a"],
            trace["released"] != 0,
        )
        return pd.DataFrame(dict(zip(TRAJECTORY_COLUMNS, columns, strict=True)))
