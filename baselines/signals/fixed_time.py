"""The fixed-time signal: one phase an approach, in turn, with Webster's greens."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from numbers import Real

from baselines.signals.heads import Heads, Phase, Program, full_order, lane_order, stopping_sight
from baselines.signals.webster import SignalTiming, timing_of, webster
from minisim.control import Command, Plan, Site, View, Wake
from minisim.errors import InputError, instance, number, numbers


@dataclass(frozen=True)
class FixedTime:
    """A signal that gives each approach its green in turn, again and again.

    The cycle is the sum of all greens, ambers and all-reds and starts with the first one's green.

    Attributes:
        greens: of each lane [s]; one number for all lanes; or None for Webster's, from the
            expected demand of the site.
        amber: [s]. With the defaults the ambers are Webster's lost times.
        saturation_flow: of a lane [veh/h].
        lost_time: a phase [s]; only Webster's formula uses it.
        equal_greens: Webster's cycle with equal greens, as in the paper's unbalanced runs.
        max_cycle: at a demand beyond Webster's formula (Y > 0.95) [s].
        all_red: after every amber [s].
        order: the lanes in the order of their greens; None is a, b, c…
        name: short name.
    """

    greens: tuple[float, ...] | float | None = None
    amber: float = 2.0
    saturation_flow: float = 1500.0
    lost_time: float = 2.0
    equal_greens: bool = False
    max_cycle: float = 180.0
    all_red: float = 0.0
    order: tuple[int, ...] | None = None
    name: str = "fixed-time"

    def __post_init__(self) -> None:
        if isinstance(self.greens, Real):
            object.__setattr__(self, "greens", _green(self.greens))
        elif self.greens is not None:
            greens = tuple(_green(green) for green in numbers("greens [s]", self.greens))
            object.__setattr__(self, "greens", greens)
        number("amber [s]", self.amber, low=0, high=60)
        number("saturation_flow [veh/h]", self.saturation_flow, low=1, high=1e5)
        number("lost_time [s]", self.lost_time, low=0, high=60)
        instance("equal_greens", self.equal_greens, bool)
        number("max_cycle [s]", self.max_cycle, above=0, high=3600)
        number("all_red [s]", self.all_red, low=0, high=60)
        object.__setattr__(self, "order", lane_order(self.order))
        instance("name", self.name, str)

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
