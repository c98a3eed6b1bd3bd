"""The result of comparing a cell, and whether it is within the stated tolerances."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

from scenarios.crossval import comparison
from scenarios.crossval.cases import Case
from scenarios.crossval.comparison import Divergence, Pair, Parting, Row, Tolerance

#: How far the means of the two hosts may differ if each has its own car-following model.
HOST_TOLERANCES: Final = {"travel_time_s": Tolerance(0.03), "waiting_time_s": Tolerance(0.10, 0.3)}
#: Share of the trips that must be the same if both hosts use the same car-following model.
HOST_SHARE: Final = 0.9

#: With fewer trips than this, a verdict says little: one trip that takes twice the mean shifts a
#: mean of 30 by 3 %, which is the whole tolerance for travel times.
FEW: Final = 30


class Failure(NamedTuple):
    """A run that failed: where, with which seed, and why."""

    host: str
    seed: int
    error: str


@dataclass(frozen=True, eq=False)
class Result:
    """The result of a case."""

    case: Case
    pairs: tuple[Pair, ...] = ()  # the seeds that both hosts finished
    collisions: tuple[int, int] = (0, 0)  # in minisim and in SUMO, over the runs that succeeded
    failures: tuple[Failure, ...] = ()
    sumo: str = ""  # its version; empty if it did not run
    parting: Parting | None = None  # None if a second run showed none or was not made

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """The statistics; empty if there are no pairs."""
        return comparison.compare(self.pairs, self.case.scenario.intersection.n)

    @cached_property
    def agreement(self) -> float:
        """Share of the trips that are the same; NaN if there are no pairs."""
        return comparison.agreement(self.pairs)

    @cached_property
    def divergence(self) -> Divergence | None:
        """The first trip of the first pair to differ between the hosts; None if none does."""
        return comparison.first_divergence(self.pairs[0]) if self.pairs else None

    def row(self, metric: str, lane: str = "all") -> Row:
        """The statistics for a metric and lane."""
        return next(row for row in self.rows if (row.metric, row.lane) == (metric, lane))

    @property
    def trips(self) -> tuple[int, int]:
        """Number of trips that ended in minisim and in SUMO, over all pairs."""
        return self.row("travel_time_s").trips if self.rows else (0, 0)

    @property
    def few(self) -> bool:
        """Whether a verdict rests on fewer than `FEW` trips in a host."""
        return self.hosts_agree is not None and min(self.trips) < FEW

    @property
    def hosts_agree(self) -> bool | None:
        """Whether the hosts agree within the stated tolerances.

        None if there is nothing to judge by: no seed ended in both hosts, or no trip in either.
        """
        if not any(self.trips):
            return None
        if self.case.same_law:
            return self.agreement >= HOST_SHARE
        return all(
            tolerance.holds(self.row(metric).minisim.mean, self.row(metric).difference.mean)
            for metric, tolerance in HOST_TOLERANCES.items()
        )

    def meets_paper(self, host: str) -> bool | None:
        """Whether a host's means are within tolerance of the published ones; None without any."""
        judged = [
            tolerance.holds(value, getattr(self.row(metric), host).mean - value)
            for metric in HOST_TOLERANCES
            if self.rows
            and (value := self.case.reference(metric, "all")) is not None
            and (tolerance := self.case.reference_tolerance(metric)) is not None
        ]
        return all(judged) if judged else None
