"""The fixed-time signal: one phase per approach, in turn, with Webster's greens."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from itertools import accumulate, count, pairwise
from numbers import Real
from typing import Any

from baselines.signals.facing import facing_switch, phases_of
from baselines.signals.heads import Colour, Heads, lane_order
from baselines.signals.permitted import PermittedHeads
from baselines.signals.webster import MIN_GREEN, SignalTiming, timing_of, webster
from minisim.control import Command, Plan, Site, View, Wake
from minisim.errors import InputError, number, numbers, plural
from minisim.names import Name
from minisim.parameters import Switch, Takes, checked, declared, real, refuse_idle, switch

#: What the head of a lane shows, in order.
_STAGES = (Colour.GREEN, Colour.AMBER, Colour.RED)


def _greens(title: str, value: Any) -> tuple[float, ...] | float:
    if isinstance(value, Real):
        return number("green [s]", value, low=0.5, high=3600)
    return tuple(number("green [s]", one, low=0.5, high=3600) for one in numbers(title, value))


@declared
class FixedTime:
    """A signal that gives each approach its green in turn, with Webster's green times.

    The cycle is the sum of all greens, ambers and all-reds and starts with the first lane's green.
    Webster's effective greens are longer than those shown by amber and all-red less `lost_time`.
    """

    name = Name("fixed-time")
    lights = True

    greens: Takes[tuple[float, ...] | float | None, Iterable[float] | float | None] = checked(
        "green of each lane, or one number for all; none means Webster's for the expected demand",
        _greens, "0.5 … 3600 | one per lane, such as (20,10,20,10)", "s",
        optional=True, default=None,
    )  # fmt: skip
    amber: float = real("amber after each green", "s", low=0, high=60, default=2.0)
    saturation_flow: float = real("of a lane", "veh/h", low=1, high=1e5, default=1500.0)
    # HCM 2000, ch. 10: amber and all-red; 2 s of start-up loss, less 2 s of amber that drivers use.
    lost_time: float | None = real(
        "time of each phase in which no vehicle leaves; none means amber and all-red", "s",
        low=0, high=120, optional=True, default=None,
    )  # fmt: skip
    equal_greens: Switch = switch(
        "whether Webster's cycle is divided equally, as in the paper's unbalanced runs",
        default=False,
    )
    max_cycle: float = real(
        "longest cycle, for a demand beyond Webster's formula (Y > 0.95); it must hold the lost "
        f"times and {MIN_GREEN:g} s of green per lane", "s",
        low=3 * MIN_GREEN, high=3600, default=180.0,
    )  # fmt: skip
    all_red: float = real("all-red after every amber", "s", low=0, high=60, default=0.0)
    order: tuple[int, ...] | None = lane_order()
    facing: Switch = facing_switch()
    plans: float | None = real(
        "length of the periods of the run with greens of their own, for a demand that varies; each "
        "begins when the last cycle before it ends; none is one plan for all", "s",
        low=60, high=1e6, optional=True, default=None,
    )  # fmt: skip

    def __post_init__(self) -> None:
        if self.greens is not None:
            websters = "lost_time", "equal_greens", "max_cycle", "plans"
            refuse_idle(self, "Webster's greens (greens=none)", *websters)

    def timing(self, site: Site, demand: Sequence[float] | None = None) -> SignalTiming:
        """The cycle and greens at this site, and each lane's degree of saturation there.

        They are for the expected `demand` of the lanes [veh/h], by default the mean over the run.

        Raises `InputError` if the number of greens is not the number of lanes, `max_cycle` is too
        short, or `order` does not list every lane once.
        """
        n, change = site.intersection.n, self.amber + self.all_red
        lost = change if self.lost_time is None else self.lost_time
        longer, flow = change - lost, self.saturation_flow
        capped, demand = False, site.demand if demand is None else demand
        phases = self.phases(site)
        if self.greens is None:
            optimum = webster(
                [max(demand[lane] for lane in phase) for phase in phases],
                saturation_flow=flow, lost_time_per_phase=lost,
                equal_greens=self.equal_greens, min_green=MIN_GREEN + max(longer, 0.0),
                max_cycle=self.max_cycle,
            )  # fmt: skip
            capped = optimum.capped
            green_of = {
                lane: green - longer
                for phase, green in zip(phases, optimum.greens, strict=True)
                for lane in phase
            }
            greens = tuple(green_of.get(lane, 0.0) for lane in range(n))
        else:
            greens = self.greens if isinstance(self.greens, tuple) else (self.greens,) * n
        if len(greens) != n:
            raise InputError(f"greens has {plural(len(greens), 'value')} for {n} lanes")
        cycle = self._program(greens, site).cycle
        return timing_of(greens, cycle, demand, flow, longer=longer, capped=capped)

    def timings(self, site: Site) -> list[SignalTiming]:
        """The timing of each plan, one after the other; a single one without `plans`."""
        if self.plans is None or site.inflow is None:
            return [self.timing(site)]
        periods = math.floor(site.inflow.starts[-1] / self.plans) + 1
        edges = [k * self.plans for k in range(periods + 1)]
        return [self.timing(site, site.expected(*edge)) for edge in pairwise(edges)]

    def start(self, site: Site) -> FixedTimeSession:
        """Begin a run; raises `InputError` as `timing` does."""
        programs = [self._program(timing.greens, site) for timing in self.timings(site)]
        heads = PermittedHeads(site, self.name) if self.facing else Heads(site)
        return FixedTimeSession(site, heads, Programs(programs, self.plans or math.inf))

    def phases(self, site: Site) -> list[tuple[int, ...]]:
        """The lanes that are green together, in the order of their greens.

        Raises `InputError` if `order` does not list every lane once.
        """
        return phases_of(self.order, site.intersection, self.facing)

    def _program(self, greens: Sequence[float], site: Site) -> Program:
        return Program(self.phases(site), greens, self.amber, self.all_red)


class Program:
    """Phases that are green in turn, over and over; the first turns green at time 0.

    What it shows follows from the time [s] alone. `phases` are the lanes of each, in the order of
    their greens. A phase is as long as the longest green of its lanes.
    """

    def __init__(
        self, phases: Sequence[Sequence[int]], greens: Sequence[float], amber: float, all_red: float
    ) -> None:
        self._phases, self._lanes = phases, len(greens)
        lengths = [max(greens[lane] for lane in phase) for phase in phases]
        stages = [time for green in lengths for time in (green, amber, all_red)]
        self._starts = list(accumulate(stages[:-1], initial=0.0))  # of stages within a cycle [s]
        self.cycle = math.fsum(green + amber + all_red for green in lengths)  # [s]

    def colours(self, time: float) -> list[Colour]:
        """What the heads of all lanes show from `time` [s] on."""
        k, stage = divmod(self._stage(time) % len(self._starts), len(_STAGES))
        shown = [Colour.RED] * self._lanes
        for lane in self._phases[k]:
            shown[lane] = _STAGES[stage]
        return shown

    def next_switch(self, time: float) -> float:
        """The first time after `time` at which a head may change [s]."""
        return self._start(self._stage(time) + 1)

    def _stage(self, time: float) -> int:
        """The stage at `time`, counted from time 0 over all cycles; never one of zero duration."""
        before = max(math.floor(time / self.cycle) * len(self._starts) - 1, 0)
        return next(stage for stage in count(before) if self._start(stage + 1) > time)

    def _start(self, stage: int) -> float:
        cycle, k = divmod(stage, len(self._starts))  # so that rounding errors do not add up
        return min(cycle * self.cycle + self._starts[k], (cycle + 1) * self.cycle)


class Programs:
    """Programs one after the other, each `length` [s] after the last or as soon as its cycle ends.

    A program for less than a cycle of the one before is left out.
    """

    def __init__(self, programs: Sequence[Program], length: float) -> None:
        self._starts, self._programs = [0.0], [programs[0]]
        for k, program in enumerate(programs[1:], start=1):
            begun, last = self._starts[-1], self._programs[-1]
            start = begun + math.ceil((k * length - begun) / last.cycle) * last.cycle
            if start < (k + 1) * length:
                self._starts.append(start)
                self._programs.append(program)

    def colours(self, time: float) -> list[Colour]:
        """What the heads of all lanes show from `time` [s] on."""
        k = bisect_right(self._starts, time) - 1
        return self._programs[k].colours(time - self._starts[k])

    def next_switch(self, time: float) -> float:
        """The first time after `time` at which a head may change [s]."""
        k = bisect_right(self._starts, time) - 1
        switch = self._starts[k] + self._programs[k].next_switch(time - self._starts[k])
        return min([switch, *self._starts[k + 1 : k + 2]])


class FixedTimeSession:
    """Shows programs; called when they switch, and while a head is late when a vehicle clears."""

    def __init__(self, site: Site, heads: Heads, programs: Programs) -> None:
        self.plan = Plan(
            wake_on_clear=True, sight=heads.sight, reach=heads.reach, marks=heads.marks
        )
        self._programs = programs
        self._heads = heads
        # In SUMO, a switch acts on the move that ends at its time.
        self._early = site.dt if site.looks_out else 0.0
        self._half_step = site.dt / 2.0
        self._wanted: list[Colour] = []
        self._until = -math.inf  # when the program shows something else [s]

    @property
    def heads(self) -> Sequence[str]:
        """What each lane's head shows now (`minisim.reasons.Signalling`)."""
        return self._heads.shown

    def green_from(self, lane: int, time: float) -> float | None:
        """When the program shows a lane green next [s]; a head may turn a little later."""
        switch = time
        for _ in range(3 * len(self._heads.colours) + 1):  # the stages of one cycle
            switch = self._programs.next_switch(switch)
            if self._programs.colours(switch)[lane] is Colour.GREEN:
                return switch - self._early
        return None  # it has no green

    def decide(self, view: View) -> Iterable[Command]:
        """Turn the heads to what the program shows; a switch less than half a step away is due."""
        now = view.time + self._half_step + self._early
        if now >= self._until:
            self._wanted = self._programs.colours(now)
            self._until = self._programs.next_switch(now)
        commands = self._heads.show(view, self._wanted)
        due = self._until - self._early
        if self._heads.rests(self._wanted):
            return [*commands, Wake(due, undisturbed=due - self._half_step)]
        return [*commands, Wake(min(due, self._heads.next_look))]
