"""`Run`, the result of a run, whoever hosted it."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
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
from minisim.results.trajectories import TRAJECTORY_COLUMNS
from minisim.results.trips import Trips, summarise, trip_table
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
    def depart_speed(self) -> float | None:
        """At insertion [m/s]; None is the highest safe one."""

    def site(self, seed: int) -> Site:
        """What the controller may know."""

    def arrivals(self, seed: int) -> Arrivals:
        """The arrival table."""


@dataclass(frozen=True, eq=False)
class Run:
    """The result of a run.

    Attributes:
        scenario, controller, seed: what was run.
        site, plan: what the controller knew and asked for.
        collisions: each pair of vehicles once.
        columns: the trips as arrays.
        record: what was recorded of the trajectories.
        trace, rows: the recording, and each row's vehicle id and path.
        counts: what the controller's session counted.
        host: what moved the vehicles, for the provenance: `host` and what else to name.
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
    host: Mapping[str, str] = field(default_factory=lambda: {"host": "minisim"})

    @cached_property
    def trips(self) -> pd.DataFrame:
        """One row a trip in demand order, columns `minisim.results.trips.TRIP_COLUMNS`."""
        return trip_table(self.columns)

    def summary(self) -> dict[str, Any]:
        """What was run and its means; see `minisim.results.trips.summarise`."""
        return {
            "controller": self.controller.name,
            "scenario": self.scenario.name,
            "profile": self.scenario.profile_name,
            "density": self.scenario.density,
            "seed": self.seed,
            "horizon_s": self.scenario.horizon,
            "host": self.host["host"],
            **summarise(self.columns, self.site.intersection.n),
            "collisions": len(self.collisions),
            **self.counts,
        }

    @property
    def provenance(self) -> dict[str, str]:
        """Version, environment and parameters: all that is needed to run it again."""
        return {
            "minisim": __version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "scenario": repr(self.scenario),
            "controller": repr(self.controller),
            "seed": str(self.seed),
            **self.host,
        }

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
