"""The fixed-time signal: one phase an approach, in turn, with Webster's greens."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from numbers import Real
from typing import Any

from baselines.signals.heads import Heads, Phase, Program, full_order, lane_order, stopping_sight
from baselines.signals.webster import SignalTiming, timing_of, webster
from minisim.control import Command, Plan, Site, View, Wake
from minisim.errors import InputError, instance, number, numbers
from minisim.parameters import checked, declared, real, spelled, switch


def _greens(title: str, value: Any) -> tuple[float, ...] | float:
    """Check `FixedTime.greens`."""
    if isinstance(value, Real):
        return _green(value)
    return tuple(_green(green) for green in numbers(title, value))


@declared
class FixedTime:
    """A signal that gives each approach its green in turn, with Webster's green times.

    The cycle is the sum of all greens, ambers and all-reds and starts with the first lane's green.
    With the defaults the ambers are Webster's lost times.
    """

    greens: tuple[float, ...] | float | None = checked(
        "green of each lane, or one number for all; none is Webster's, from the expected demand",
        _greens, "numbers 0.5 … 3600", "s", optional=True, default=None,
    )  # fmt: skip
    amber: float = real("amber after each green", "s", low=0, high=60, default=2.0)
    saturation_flow: float = real(
        "saturation flow of a lane", "veh/h", low=1, high=1e5, default=1500.0
    )
    lost_time: float = real(
        "lost time of each phase, which only Webster's formula uses", "s",
        low=0, high=60, default=2.0,
    )  # fmt: skip
    equal_greens: bool = switch(
        "whether Webster's cycle is divided equally, as in the paper's unbalanced runs",
        default=False,
    )
    max_cycle: float = real(
        "longest cycle, for a demand beyond Webster's formula (Y > 0.95)", "s",
        above=0, high=3600, default=180.0,
    )  # fmt: skip
    all_red: float = real("all-red after every amber", "s", low=0, high=60, default=0.0)
    order: tuple[int, ...] | None = lane_order()

    @property
    def name(self) -> str:
        """Its spelling, such as `fixed-time:equal_greens=true`."""
        return spelled("fixed-time", self)

    def timing(self, site: Site) -> SignalTiming:
        """The cycle and greens at this site, and each lane's degree of saturation there.

        Raises:
            InputError: as many greens as lanes are needed, `max_cycle` is too short, or `order`
                is not all lanes, each once.
        """
        instance("site", site, Site)
        n = site.intersection.n
        if self.greens is None:
            optimum = webster(
                site.demand,
                saturation_flow=self.saturation_flow,
                lost_time_per_phase=self.lost_time,
                equal_greens=self.equal_greens,
                max_cycle=self.max_cycle,
            )
            greens, capped = optimum.greens, optimum.capped
        elif isinstance(self.greens, tuple):
            greens, capped = self.greens, False
        else:
            greens, capped = (self.greens,) * n, False
        if len(greens) != n:
            raise InputError(f"greens has {len(greens)} values for {n} lanes")
        cycle = self._program(greens).cycle
        return timing_of(greens, cycle, site.demand, self.saturation_flow, capped=capped)

    def start(self, site: Site) -> FixedTimeSession:
        """Begin a run; raises `InputError` as `timing` does."""
        return FixedTimeSession(site, self._program(self.timing(site).greens))

    def _program(self, greens: Sequence[float]) -> Program:
        order = full_order(self.order, len(greens))
        return Program(
            tuple(Phase((lane,), greens[lane], self.amber, self.all_red) for lane in order)
        )


class FixedTimeSession:
    """Shows a program; called when it switches, and when a vehicle clears the junction."""

    def __init__(self, site: Site, program: Program) -> None:
        self.plan = Plan(wake_on_clear=True, sight=stopping_sight(site))
        self._program = program
        self._heads = Heads(site)
        self._half_step = site.dt / 2.0
        self._lanes = site.intersection.n

    def decide(self, view: View) -> Iterable[Command]:
        """Turn the heads to what the program shows now.

        Timers ring on whole steps: a switch less than half a step away is due.
        """
        now = view.time + self._half_step
        wanted = self._program.colours(now, self._lanes)
        return [*self._heads.show(view, wanted), Wake(self._program.next_switch(now))]


def _green(value: object) -> float:
    return number("green [s]", value, low=0.5, high=3600)
