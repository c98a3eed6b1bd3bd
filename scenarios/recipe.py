"""One recipe of a run, from which every entrance starts: Python, the command line, files, studies.

    run = Recipe(four_way(250.0), Dim(gate="harmonious"), seed=1, humans=0.2).run()
    run.summary()

Two entrances that describe the same recipe get the same numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from dim import Dim, Mixed
from minisim.control import Controller
from minisim.errors import InputError, show
from minisim.parameters import checked, declared, part, real, text, whole, word
from minisim.results.metrics import Metric, named_metrics, recording
from minisim.results.run import Run
from scenarios.scenario import Scenario

#: What a collision may do to a run; "teleport" is for SUMO only.
ON_COLLISION = ("stop", "record", "teleport")

#: Makes a run of a scenario, a controller and a seed, such as `minisim.simulate`.
Host = Callable[..., Run]


def _controller(title: str, value: Any) -> Controller:
    if isinstance(value, Controller) and not isinstance(value, type):
        return value
    missing = [part for part in ("name", "start") if not hasattr(value, part)]
    lack = f"which has no {' and no '.join(missing)}" if missing else "which is a class"
    raise InputError(f"{title} must be a Controller, got {show(value)}, {lack}")


@declared
class Recipe:
    """One run to be made: what is simulated, who decides, and the seed.

    Raises:
        InputError: a value that is not allowed, or humans with a controller other than DIM.
    """

    scenario: Scenario = part("what is simulated", Scenario)
    controller: Controller = checked("who decides", _controller, "Controller")
    seed: int = whole("of the random streams", low=0, default=0)
    humans: float = real(
        "share of human drivers among the vehicles of DIM",
        low=0, high=1, default=0.0, label="share of humans",
    )  # fmt: skip
    label: str = text("what rows call the controller; its own name where empty", default="")
    on_collision: str = word(
        "a collision ends the run, is noted, or removes a vehicle (in SUMO)",
        ON_COLLISION, default="stop",
    )  # fmt: skip

    metrics: tuple[str | Metric, ...] = checked(
        "what rows have besides the usual (`minisim.results.metrics`)",
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
            host: `minisim.simulate`, or another function that takes the same arguments.
            options: of the host, such as `record`.

        Raises:
            InputError: an option that is not allowed, or a scenario that the controller cannot
                serve.
            CollisionError: a collision, where `on_collision` is "stop".
        """
        from minisim.simulation import simulate

        host = host or simulate
        if options.get("record") is None and (record := recording(self.metrics)):
            options["record"] = record
        return host(
            self.scenario, self.driven, self.seed, on_collision=self.on_collision, **options
        )
