"""Points of figures: everything about a run except its seed and horizon."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from itertools import product
from typing import Any, NamedTuple, Protocol

from scenarios.controllers import controller_named
from scenarios.library import MAKERS, regular
from scenarios.recipe import Recipe


class Point(Protocol):
    """One point of a figure: a named tuple of plain values, which become columns."""

    @property
    def series(self) -> str:
        """The line of the figure."""

    @property
    def arms(self) -> int:
        """Of the junction."""

    @property
    def density(self) -> float:
        """Mean inflow per lane [veh/h]."""

    @property
    def where(self) -> str:
        """What sets it apart from other points of its series, besides demand."""

    def recipe(self, seed: int, horizon: float = 3600.0) -> Recipe:
        """The run of one seed."""

    def _asdict(self) -> dict[str, Any]:
        """Its columns."""


class ControllerPoint(NamedTuple):
    """A controller at a demand."""

    profile: str  # by name
    series: str  # the controller as readers know it, such as "dim"
    controller: str  # the variant of it that the study needs, as on the command line
    arms: int  # of the junction
    split: str  # of the inflow over the lanes: "balanced", or shares such as "4:3:2:1"
    density: float  # mean inflow per lane [veh/h]
    humans: float = 0.0  # share of human drivers

    def recipe(self, seed: int, horizon: float = 3600.0) -> Recipe:
        """The run of one seed. Collisions are counted: some published rules have them."""
        make = MAKERS.get(self.arms) or partial(regular, self.arms)
        scenario = make(self.density, split=self.split, profile=self.profile, horizon=horizon)
        controller = controller_named(self.controller, self.profile)
        label = f"{self.series}+humans={self.humans:g}" if self.humans else self.series
        return Recipe(scenario, controller, seed, self.humans, label=label, on_collision="record")

    @property
    def where(self) -> str:
        """What sets it apart from other points of its series, besides demand."""
        humans = f"{self.humans:.0%} humans, " if self.humans else ""
        return f"{humans}{self.arms} arms, {self.split}"


def fair(name: str, arms: int, density: float, humans: float = 0.0) -> ControllerPoint:
    """A controller on equal terms: the profile `fair` and the same inflow on every lane."""
    return ControllerPoint("fair", name, name, arms, "balanced", float(density), humans)


def fair_grid(
    controllers: Iterable[str], arms: Iterable[int], densities: Iterable[float]
) -> tuple[ControllerPoint, ...]:
    """Every combination of controllers, arms and demands [veh/h/lane] on equal terms."""
    return tuple(fair(name, n, q) for n, name, q in product(arms, controllers, densities))
