"""Cycle and green times of a fixed-time signal, and the delay to expect (Webster 1958).

F. V. Webster, Traffic Signal Settings, Road Research Technical Paper 39, HMSO 1958. Flows are in
veh/h, as in that book; times in seconds. A phase is its green, amber and all-red. Part of it is
lost, while the queue starts and the junction clears; in the rest, the effective green, vehicles
leave at the saturation flow.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from minisim.errors import InputError, instance, number, numbers

#: Above this flow ratio the optimum cycle is useless (it is infinite at 1) and is capped.
MAX_FLOW_RATIO = 0.95
#: Green of a lane with hardly any traffic [s]. It lets a vehicle at the line across, and does not
#: change Webster's own greens at the paper's demands, which are at least 2.03 s.
MIN_GREEN = 2.0


@dataclass(frozen=True)
class SignalTiming:
    """A signal's timing and what it means for a demand."""

    cycle: float  #: [s]
    greens: tuple[float, ...]  #: of each lane [s]
    flow_ratio: float  #: Webster's Y, the sum over the lanes of inflow over saturation flow
    #: Degree of saturation x = qC/(sg) by lane, g its effective green; above 1 its queue grows.
    saturation: tuple[float, ...]
    capped: bool = False  #: whether the optimum cycle was cut to a maximum (or does not exist)


def webster(
    rates: Iterable[float],
    *,
    saturation_flow: float = 1500.0,
    lost_time_per_phase: float = 2.0,
    equal_greens: bool = False,
    min_green: float = MIN_GREEN,
    max_cycle: float = 180.0,
) -> SignalTiming:
    """Cycle and effective greens, one phase per lane: C0 = (1.5L + 5)/(1 − Y), g = (y/Y)(C0 − L).

    `max_cycle` caps the cycle only if Y > 0.95, even if no optimum exists (Y ≥ 1). A lane
    whose share is below `min_green` gets `min_green`. That lengthens the cycle; in a capped cycle
    the other lanes share the rest. `rates` are the inflows of the lanes [veh/h]; L is
    `lost_time_per_phase` [s] times their number. `equal_greens` divides the greens equally.

    Raises `InputError` if a value is out of range or `max_cycle` too short for the minimal greens.
    """
    flows = numbers("rates [veh/h]", rates)
    if not flows:
        raise InputError("rates must have at least one lane")
    for flow in flows:
        number("rate [veh/h]", flow, low=0, high=1e5)
    n = len(flows)
    saturation_flow = number("saturation_flow [veh/h]", saturation_flow, low=1, high=1e5)
    lost = n * number("lost_time_per_phase [s]", lost_time_per_phase, low=0, high=120)
    instance("equal_greens", equal_greens, bool)
    min_green = number("min_green [s]", min_green, above=0, high=600)
    max_cycle = number("max_cycle [s]", max_cycle, low=lost + n * min_green, high=3600)

    ratio = sum(flows) / saturation_flow
    capped = ratio > MAX_FLOW_RATIO and optimal_cycle(ratio, lost) > max_cycle
    total = (max_cycle if capped else optimal_cycle(ratio, lost)) - lost
    shares = (1.0,) * n if equal_greens or ratio == 0.0 else flows
    greens = [total * share / sum(shares) for share in shares]
    if capped:
        greens = _raise_within(greens, min_green)
    greens = [max(green, min_green) for green in greens]
    return timing_of(greens, sum(greens) + lost, flows, saturation_flow, capped=capped)


def optimal_cycle(flow_ratio: float, lost_time: float) -> float:
    """Webster's minimum-delay cycle, (1.5L + 5)/(1 − Y) [s]; infinite for Y ≥ 1."""
    return (1.5 * lost_time + 5.0) / (1.0 - flow_ratio) if flow_ratio < 1.0 else math.inf


def timing_of(
    greens: Iterable[float], cycle: float, rates: Iterable[float], saturation_flow: float,
    *, longer: float = 0.0, capped: bool = False,
) -> SignalTiming:  # fmt: skip
    """Greens and cycle [s] for inflows `rates` [veh/h]; effective greens last `longer` [s] more."""
    greens, rates = tuple(greens), tuple(rates)
    saturation = tuple(
        rate * cycle / (saturation_flow * (green + longer)) if rate else 0.0
        for rate, green in zip(rates, greens, strict=True)
    )
    return SignalTiming(cycle, greens, sum(rates) / saturation_flow, saturation, capped)


def webster_delay(rate: float, green: float, cycle: float, saturation_flow: float = 1500) -> float:
    """Mean delay of a vehicle on one lane in the long run [s].

    d = C(1−λ)²/(2(1−λx)) + x²/(2q(1−x)) − 0.65 (C/q²)^(1/3) x^(2+5λ), with cycle C [s],
    effective green g [s], λ = g/C, inflow `rate` q [veh/h in, veh/s here], saturation flow s
    [veh/h] and the degree of saturation x = qC/(sg); infinite for x ≥ 1. Near x = 1 it overstates
    the delay in a finite run, where the queue has not had time to grow.
    """
    rate = number("rate [veh/h]", rate, low=0, high=1e5)
    cycle = number("cycle [s]", cycle, above=0, high=1e5)
    green = number("green [s]", green, low=0.1, high=cycle)
    saturation_flow = number("saturation_flow [veh/h]", saturation_flow, low=1, high=1e5)
    share = green / cycle
    x = rate / (saturation_flow * share)
    if x >= 1.0:
        return math.inf
    uniform = cycle * (1.0 - share) ** 2 / (2.0 * (1.0 - share * x))
    q = rate / 3600.0
    if q == 0.0:  # the limit: no vehicle waits for another
        return uniform
    random = x * x / (2.0 * q * (1.0 - x))
    correction = 0.65 * (math.cbrt(cycle) / math.cbrt(q) ** 2) * math.pow(x, 2.0 + 5.0 * share)
    return uniform + random - correction


def _raise_within(greens: Sequence[float], low: float) -> list[float]:
    """Raise greens to `low` and shorten the others in proportion; the sum stays the same."""
    raised: set[int] = set()
    result = list(greens)
    while below := {i for i, green in enumerate(result) if green < low} - raised:
        raised |= below
        rest = sum(greens) - low * len(raised)
        others = sum(green for i, green in enumerate(greens) if i not in raised)
        result = [low if i in raised else green * rest / others for i, green in enumerate(greens)]
    return result
