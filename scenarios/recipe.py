"""The recipe of a run. It gives the same numbers in Python, on the command line and in files.

run = Recipe(four_way(250.0), Dim(gate="harmonious"), seed=1, humans=0.2).run()
run.summary()
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from dim import Dim, Mixed
from minisim.channel import Channel
from minisim.control import Controller, as_controller
from minisim.errors import InputError, show
from minisim.hosting import REACTIONS
from minisim.link import Linked
from minisim.names import name_of
from minisim.parameters import Spelled, Takes, checked, declared, part, real, text, whole, word
from minisim.results.asked import Asked, asked_metrics
from minisim.results.metric import Metric
from minisim.results.run import Run
from scenarios.controllers import controller_named
from scenarios.loading import metrics_named
from scenarios.scenario import Scenario

#: Makes a run of a scenario, a controller and a seed, such as `minisim.simulate`.
Host = Callable[..., Run]


def _controller(title: str, value: Any) -> Any:
    """Check `Recipe.controller`; what a text means depends on the profile."""
    named = isinstance(value, str | Mapping)
    return value if named else as_controller(value, f"{title} {show(value)}")


@declared
class Recipe:
    """One run: what is simulated, which controller decides, and the seed.

    `InputError` for a value that is not allowed, humans with a controller other than DIM, or
    messages that fail with a controller that sends none.
    """

    scenario: Scenario = part("what is simulated", Scenario)
    controller: Spelled[Controller] = checked(
        "decides which vehicles go; a text or table as for `controller_named` means the same",
        _controller, "Controller",
    )  # fmt: skip
    seed: int = whole("of the random streams", low=0, default=0)
    humans: float = real(
        "share of human drivers among the vehicles of DIM",
        low=0, high=1, default=0.0, label="share of humans",
    )  # fmt: skip
    latency: float = real("of messages (`minisim.channel`)", "s", low=0, high=60, default=0.0)
    jitter: float = real("how much longer they may take", "s", low=0, high=60, default=0.0)
    loss: float = real("share of messages that never arrive", low=0, high=1, default=0.0)
    label: str = text("what rows call the controller; if empty, its name", empty=True, default="")
    on_collision: str = word(
        "a collision ends the run, is noted, or removes a vehicle (SUMO, cruise control)",
        REACTIONS, default="stop",
    )  # fmt: skip
    metrics: Takes[tuple[str | Metric, ...], str | Iterable[Asked]] = checked(
        "columns besides the usual ones (`minisim.results.metrics`)",
        lambda _, value: metrics_named(value),
        "names, module:name and Metrics", default=(),
    )  # fmt: skip

    def __post_init__(self) -> None:
        named = controller_named(self.controller, self.scenario.profile)
        object.__setattr__(self, "controller", named)
        if self.humans and not isinstance(self.controller, Dim):
            raise InputError(
                f"humans drive among vehicles of DIM (the controller dim), not with "
                f"{name_of(self.controller)!r}"
            )
        if channel := Channel(self.latency, self.jitter, self.loss):
            Linked(self.controller, channel)  # refuses a controller that sends no messages

    @property
    def driven(self) -> Controller:
        """The controller of the run, with its human drivers or messages that fail."""
        if self.humans and isinstance(self.controller, Dim):
            return Mixed(self.controller, self.humans)
        channel = Channel(self.latency, self.jitter, self.loss)
        return Linked(self.controller, channel) if channel else self.controller

    @property
    def name(self) -> str:
        """What rows call the controller."""
        return self.label or name_of(self.driven)

    def run(self, host: Host | None = None, **options: Any) -> Run:
        """Simulate it, and record what its metrics need.

        `host` is `minisim.simulate` by default; `options` are more of its arguments, such as
        `record`. Raises `InputError` for an option that is not allowed or a scenario that the
        controller cannot serve, and `CollisionError` for a collision if `on_collision` is "stop".
        """
        from minisim.simulation import simulate

        needs = {metric.needs for metric in asked_metrics(self.metrics)}
        if "whole trajectories" in needs:
            options["record"] = "all"
        elif "trajectories" in needs:
            options["record"] = options.get("record") or "junction"
        if "decisions" in needs:
            options["timed"] = True
        options["on_collision"] = self.on_collision
        return (host or simulate)(self.scenario, self.driven, self.seed, **options)
