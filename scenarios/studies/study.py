"""What is simulated for which question: named sets of cases, each repeated over seeds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

from minisim.control import Controller
from minisim.errors import choice
from scenarios.controllers import RIVALS, controller_named
from scenarios.library import MAKERS, regular
from scenarios.paper import BASELINE_GRID, DENSITIES, GRID, SERIES, Cell, controller_of
from scenarios.paper import scenario as published_scenario
from scenarios.recipe import Recipe
from scenarios.scenario import Scenario
from scenarios.studies.misreading import ERRORS, MISREADERS, THRESHOLD_CASES

#: Stands for the profile and controller of a published run, see `scenarios.paper`.
AS_RUN = "as-run"

#: The paper's grid: four controllers on four arms, and DIM on three and five.
PUBLISHED = (*GRID, *BASELINE_GRID)


class Case(NamedTuple):
    """One point of a figure: everything of a run but its seed and horizon.

    Attributes:
        profile: by name; `AS_RUN` is whatever the published run of this cell had.
        series: the line of the figure that the point lies on: the controller that a reader
            thinks of, such as "dim", whatever variant of it the profile needs.
        controller: by its command-line name; `AS_RUN` is the published run's.
        arms: of the junction.
        split: of the inflow over the lanes, "balanced" or such as "4:3:2:1".
        density: mean inflow a lane [veh/h].
        humans: share of human drivers.
    """

    profile: str
    series: str
    controller: str
    arms: int
    split: str
    density: float
    humans: float = 0.0

    def experiment(self, seed: int, horizon: float = 3600.0) -> Recipe:
        """The run of one seed; collisions are counted, for some published rules have them."""
        if self.profile == AS_RUN:
            scenario, controller = self._published(horizon)
        else:
            scenario = self._drawn(horizon)
            controller = controller_named(self.controller, self.profile)
        return Recipe(
            scenario, controller, seed, self.humans, label=self.label, on_collision="record"
        )

    @property
    def label(self) -> str:
        """What rows call the controller."""
        return f"{self.series}-humans-{self.humans:g}" if self.humans else self.series

    def _drawn(self, horizon: float) -> Scenario:
        make = MAKERS.get(self.arms) or partial(regular, self.arms)
        return make(self.density, split=self.split, profile=self.profile, horizon=horizon)

    def _published(self, horizon: float) -> tuple[Scenario, Controller]:
        """What ran, also where that is not what the label says."""
        name = {ours: theirs for theirs, ours in SERIES.items()}[self.series]
        cell = Cell(self.split, int(self.density), self.arms, name)
        return replace(published_scenario(*cell), horizon=horizon), controller_of(*cell)

    @property
    def where(self) -> str:
        """What tells it from other cases of its series, but for the demand."""
        humans = f"{self.humans:.0%} humans, " if self.humans else ""
        return f"{humans}{self.arms} arms, {self.split}"

    def __str__(self) -> str:
        return f"{self.series}, {self.where}, {self.density:g} veh/h/lane"


class AnyCase(Protocol):
    """A point of a figure: a `Case`, or one with other axes. A named tuple of plain values."""

    @property
    def series(self) -> str:
        """The line of the figure that it lies on."""

    @property
    def arms(self) -> int:
        """Of the junction."""

    @property
    def density(self) -> float:
        """Mean inflow a lane [veh/h]."""

    @property
    def where(self) -> str:
        """What tells it from other cases of its series, but for the demand."""

    def experiment(self, seed: int, horizon: float = 3600.0) -> Recipe:
        """The run of one seed."""

    def _asdict(self) -> dict[str, Any]:
        """Its columns."""


@dataclass(frozen=True)
class Study:
    """Cases that answer one question.

    Attributes:
        name: on the command line.
        question: in one line.
        cases: without repetition.
        few: series -> most seeds, where a run costs too much for more.
    """

    name: str
    question: str
    cases: tuple[AnyCase, ...]
    few: Mapping[str, int] = field(default_factory=dict)

    def runs(
        self, seeds: int, horizon: float = 3600.0, cases: Iterable[AnyCase] | None = None
    ) -> list[tuple[AnyCase, Recipe]]:
        """The seeds 1 … `seeds` of all cases or some, seed by seed within each case."""
        return [
            (case, case.experiment(seed, horizon))
            for case in (self.cases if cases is None else cases)
            for seed in range(1, min(seeds, self.few.get(case.series, seeds)) + 1)
        ]


#: What the text has for unbalanced inflow: "the lane priorities are set according to the incoming
#: traffic", and the greens of its table, the same for every lane (§ Comparison Models).
_UNBALANCED = {"dim": "dim:priorities=inflow", "fixed-time": "fixed-time:equal_greens=true"}


def _as_text(cell: Cell) -> Case:
    """A published cell by the rules and parameters of the text."""
    series = SERIES[cell.controller]
    controller = series if cell.split == "balanced" else _UNBALANCED.get(series, series)
    return Case("paper", series, controller, cell.arms, cell.split, float(cell.density))


def _as_run(cell: Cell) -> Case:
    """A published cell as it was run."""
    series = SERIES[cell.controller]
    return Case(AS_RUN, series, AS_RUN, cell.arms, cell.split, float(cell.density))


#: The published V2I-C decides every 0.01 s and costs some 20 s of CPU a simulated hour, a hundred
#: times a signal; its runs differ little.
_FEW = {"v2ic": 3}

#: Vehicles that misread each other look around every 0.1 s, which costs 3 s of CPU an hour, and
#: more with a monitor.
_FEW_MISREAD = dict.fromkeys(MISREADERS, 5)

#: From nearly free flow to far beyond the capacity of every controller [veh/h/lane].
FAIR_DENSITIES = (50, 100, 150, 200, 250, 300, 350, 400, 500, 600, 700, 800)

#: Rules of priority that need no communication.
PRIORITIES = ("dim", "dim:priorities=rotating", "dim:priorities=waiting")


#: Shares of human drivers, from none to all.
HUMAN_SHARES = (0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)

#: Demands at which they are compared [veh/h/lane]: moderate, and near what all humans can do.
HUMAN_DENSITIES = (150.0, 250.0)


#: Who drives among humans, and what humans alone are compared with.
HUMAN_GATES = ("dim", "dim:gate=harmonious")
STOP = "all-way-stop"


def _human_cases() -> tuple[Case, ...]:
    return (
        *(
            Case("fair", name, name, 4, "balanced", density, share)
            for density, name, share in product(HUMAN_DENSITIES, HUMAN_GATES, HUMAN_SHARES)
        ),
        *(Case("fair", STOP, STOP, 4, "balanced", density) for density in HUMAN_DENSITIES),
    )


def _cases(
    controllers: Iterable[str], arms: Iterable[int], densities: Iterable[float]
) -> tuple[Case, ...]:
    return tuple(
        Case("fair", name, name, n, "balanced", float(density))
        for n, name, density in product(arms, controllers, densities)
    )


STUDIES: MappingProxyType[str, Study] = MappingProxyType({
    study.name: study
    for study in (
        Study("text", "What do the paper's rules and parameters give, as its text prescribes them?",
              tuple(map(_as_text, PUBLISHED))),
        Study("as-run", "What do the rules and vehicles that produced the published numbers give?",
              tuple(map(_as_run, PUBLISHED)), _FEW),
        Study("fair", "Which controller is best with one vehicle and speed limit for all?",
              _cases(RIVALS, (4,), FAIR_DENSITIES)),
        Study("gate", "What does entering beside crossing vehicles in harmony gain?",
              _cases(("dim", "dim:gate=harmonious"), (3, 4, 5), DENSITIES)),
        Study("fairness", "Who waits under which rule of priority?",
              _cases(PRIORITIES, (4,), DENSITIES)),
        Study("humans", "What do human drivers cost, and whom?", _human_cases()),
        Study("perception", "What happens when vehicles misread each other's intent?", ERRORS,
              _FEW_MISREAD),
        Study("confidence", "What does it cost to believe only readings that are sure?",
              THRESHOLD_CASES, _FEW_MISREAD),
    )
})  # fmt: skip


def study_named(name: str) -> Study:
    """A study by name; raises `InputError` with the nearest one."""
    return STUDIES[choice("study", name, STUDIES)]
