"""Controllers whose messages come late or get lost, beside DIM, which sends none."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, NamedTuple

from scenarios.controllers import CONTROLLERS, FAMILIES, RADIO, controller_named, label_of
from scenarios.library import four_way
from scenarios.recipe import Recipe
from scenarios.studies.fair import GATES, Crossing, crossing, paired_differences
from scenarios.studies.shared.study import TOTAL_DELAY, Results, Study, with_total_delay

if TYPE_CHECKING:
    import pandas as pd

#: The controllers that send messages, as they are by default.
TALKING = tuple(name for name in FAMILIES[RADIO] if name in CONTROLLERS)
#: Demands: a moderate one, and one at which every controller still has room [veh/h/lane].
DENSITIES = (150.0, 250.0)
#: Shares of messages lost, if the others come at once.
LOSSES = (0.1, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9)
#: Delays of messages, if none is lost [s].
LATENCIES = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0)
#: Faults compared: latency [s], loss. The last are both at once: the most that 3GPP allows between
#: vehicles and the roadside (TS 22.185), and to platoons of the lowest degree (TS 22.186).
FAULTS = (
    (0.0, 0.0), *((0.0, loss) for loss in LOSSES), *((time, 0.0) for time in LATENCIES), (0.1, 0.1),
)  # fmt: skip
#: Half an hour shows it: queues that grow do so within minutes [s].
HORIZON = 1800.0


class MessagePoint(NamedTuple):
    """A controller at a demand, with messages that fail."""

    series: str  # the controller, as on the command line
    density: float  # mean inflow per lane [veh/h]
    latency: float = 0.0  # [s]
    loss: float = 0.0
    arms: int = 4  # of the junction

    def recipe(self, seed: int, horizon: float = HORIZON) -> Recipe:
        """The run of one seed."""
        scenario = four_way(self.density, profile="fair", horizon=horizon)
        controller = controller_named(self.series, scenario.profile)
        return Recipe(
            scenario, controller, seed, latency=self.latency, loss=self.loss, on_collision="record"
        )

    @property
    def where(self) -> str:
        """What sets it apart from other points of its series, besides demand."""
        return f"latency {self.latency:g} s, loss {self.loss:.0%}"


#: What fails, in a unit that gives whole numbers -> its values, and the factor of that unit.
AXES = {"loss [%]": ("loss", LOSSES, 100.0), "latency [ms]": ("latency", LATENCIES, 1000.0)}

#: What fails, DIM's gate, the rival, and the demand [veh/h/lane].
Duel = tuple[str, str, str, float]


def wins(rows: pd.DataFrame) -> dict[Duel, Crossing]:
    """From where on DIM has less total delay than a rival whose messages fail.

    Duels without two faults in common are left out.
    """
    rows = with_total_delay(rows)
    known: dict[Duel, Crossing] = {}
    for (what, (column, values, unit)), gate, rival in product(AXES.items(), GATES, TALKING):
        other = "latency" if column == "loss" else "loss"
        by_density: dict[float, dict[float, list[float]]] = {}
        for value in (0.0, *values):
            failing = (rows[column] == value) & (rows[other] == 0.0)
            chosen = rows[(rows["series"] == gate) | ((rows["series"] == rival) & failing)]
            for density, more in paired_differences(chosen, rival, gate, TOTAL_DELAY).items():
                by_density.setdefault(density, {})[unit * value] = more
        for density, differences in by_density.items():
            if len(differences) > 1:
                known[what, gate, rival, density] = crossing(differences)
    return known


def verdict(results: Results) -> str:
    """The loss and the latency from which DIM wins."""
    known = {} if results.good.empty else wins(results.good)
    if not known:
        command = results.effort.command("messages")
        return f"The loss from which DIM wins is not known: make the runs with: {command}."
    lines = [
        f"- {label_of(gate)} against {label_of(rival)}, {density:g} veh/h/lane: {what} {it}"
        for (what, gate, rival, density), it in known.items()
    ]
    return "\n".join([
        "Faults of messages from which DIM, which sends none, has less delay on four arms, with 95 "
        "% intervals:\n",
        *lines,
    ])  # fmt: skip


STUDY = Study(
    "messages",
    "At which loss and latency of messages does DIM win, which needs none?",
    (
        *(MessagePoint(gate, density) for density, gate in product(DENSITIES, GATES)),
        *(
            MessagePoint(name, density, *fault)
            for density, name, fault in product(DENSITIES, TALKING, FAULTS)
        ),
    ),
    verdict=verdict,
    longest=HORIZON,
)
