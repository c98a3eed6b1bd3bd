"""The recipe of a run. Python, the command line, files and studies all start from one.

    run = Recipe(four_way(250.0), Dim(gate="harmonious"), seed=1, humans=0.2).run()
    run.summary()

The same recipe gives the same numbers, wherever it comes from.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from dim import Dim, Mixed
from minisim.control import Controller
from minisim.errors import InputError, show
from minisim.hosting import REACTIONS
from minisim.parameters import checked, declared, part, real, text, whole, word
from minisim.results.metrics import Metric, named_metrics, recording
from minisim.results.run import Run
from scenarios.controllers import check_controller
from scenarios.scenario import Scenario

#: Makes a run of a scenario, a controller and a seed, such as `minisim.simulate`.
Host = Callable[..., Run]


@declared
class Recipe:
    """One run: what is simulated, which controller decides, and the seed.

    Raises:
        InputError: a value that is not allowed, or humans with a controller other than DIM.
    """

    scenario: Scenario = part("what is simulated", Scenario)
    controller: Controller = checked(
        "decides who goes", lambda _, value: check_controller(show(value), value), "Controller"
    )
    seed: int = whole("of the random streams", low=0, default=0)
    humans: float = real(
        "share of human drivers among the vehicles of DIM",
        low=0, high=1, default=0.0, label="share of humans",
    )  # fmt: skip
    label: str = text("what rows call the controller; its own name where empty", default="")
    on_collision: str = word(
        "a collision ends the run, is noted, or removes a vehicle (SUMO, cruise control)",
        REACTIONS, default="stop",
    )  # fmt: skip
    metrics: tuple[str | Metric, ...] = checked(
        "columns besides the usual ones (`minisim.results.metrics`)",
        lambda _, value: named_metrics(value),
        "names and Metrics", default=(),
    )  # fmt: skip

    def __post_init__(self) -> None:
        if self.humans and not isinstance(self.controller, Dim):
            raise InputError(
                f"humans drive among vehicles of DIM (the controller dim), not with "
                f"{self.controller.name!r}"
            )

    @property
    def driven(self) -> Controller:
        """The controller of the run, with its human drivers."""
        if self.humans and isinstance(self.controller, Dim):
            return Mixed(self.controller, self.humans)
        return self.controller

    @property
    def name(self) -> str:
        """What rows call the controller."""
        return self.label or self.driven.name

    def run(self, host: Host | None = None, **options: Any) -> Run:
        """Simulate it, and record what its metrics need.

        Args:
            host: `minisim.simulate` unless given; takes the same arguments.
            options: more arguments of the host, such as `record`.

        Raises:
            InputError: an option that is not allowed, or a scenario that the controller cannot
                serve.
            CollisionError: a collision, where `on_collision` is "stop".
        """
        from minisim.simulation import simulate

        if options.get("record") is None and (record := recording(self.metrics)):
            options["record"] = record
        return (host or simulate)(
            self.scenario, self.driven, self.seed, on_collision=self.on_collision, **options
        )
