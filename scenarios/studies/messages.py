"""Controllers whose messages come late or get lost, beside DIM, which sends none."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

from scenarios.controllers import controller_named
from scenarios.library import four_way
from scenarios.recipe import Recipe
from scenarios.studies.fair import GATES
from scenarios.studies.shared.study import Study

#: The controllers that send messages.
TALKING = ("v2ic", "reservation")
#: Demands: a moderate one, and one at which every controller still has room [veh/h/lane].
DENSITIES = (150.0, 250.0)
#: Shares of messages lost, if the others come at once.
LOSSES = (0.1, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9)
#: Delays of messages, if none is lost [s].
LATENCIES = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0)
#: Faults compared: latency [s], loss. The last are both at once: the latency that 3GPP TS 22.185
#: still allows, and one message lost in ten.
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
        """The run of one seed, of half an hour at most."""
        scenario = four_way(self.density, profile="fair", horizon=min(horizon, HORIZON))
        controller = controller_named(self.series, scenario.profile)
        return Recipe(
            scenario, controller, seed, latency=self.latency, loss=self.loss, on_collision="record"
        )

    @property
    def where(self) -> str:
        """What sets it apart from other points of its series, besides demand."""
        return f"latency {self.latency:g} s, loss {self.loss:.0%}"


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
)
