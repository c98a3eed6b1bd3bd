"""Webster's timing and signal programs for any demand."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.signals.fixed_time import Program
from baselines.signals.heads import Colour
from baselines.signals.webster import MIN_GREEN, webster, webster_delay
from scenarios.strategies import floats

RATES = st.lists(floats(0.0, 3600.0), min_size=3, max_size=12)


@given(RATES, st.booleans())
def test_any_demand_has_a_timing(rates: list[float], equal: bool) -> None:
    timing = webster(rates, equal_greens=equal)
    assert min(timing.greens) >= MIN_GREEN - 1e-9
    assert sum(timing.greens) + 2.0 * len(rates) == pytest.approx(timing.cycle)
    assert timing.capped == (timing.flow_ratio > 0.95)
    if timing.capped:
        assert timing.cycle == pytest.approx(180.0)
    served = [x for x, g in zip(timing.saturation, timing.greens, strict=True) if g > MIN_GREEN]
    if not equal and served:
        assert served == pytest.approx([served[0]] * len(served))
        assert max(timing.saturation) <= served[0] * (1.0 + 1e-9)


@given(st.integers(3, 6), floats(0.3, 0.9))
def test_websters_cycle_is_close_to_the_least_delay(n: int, ratio: float) -> None:
    """Webster 1958: from ¾ to 1½ of the optimum cycle the delay is hardly more than the least."""
    rate, lost = 1500.0 * ratio / n, 2.0 * n
    optimum = webster([rate] * n, min_green=0.1).cycle

    def delay(cycle: float) -> float:
        return webster_delay(rate, (cycle - lost) / n, cycle)

    least = min(delay(optimum * factor / 100) for factor in range(40, 400, 2))
    assert delay(optimum) <= 1.1 * least


@st.composite
def programs(draw: st.DrawFn) -> Program:
    n = draw(st.integers(2, 5))
    return Program(
        [(lane,) for lane in range(n)],
        draw(st.lists(floats(0.5, 60.0), min_size=n, max_size=n)),
        amber=draw(st.sampled_from([0.0, 2.0, 3.5])),
        all_red=draw(st.sampled_from([0.0, 1.0])),
    )


@given(programs(), floats(0.0, 1e5))
def test_a_program_shows_the_same_until_it_switches(program: Program, time: float) -> None:
    switch = program.next_switch(time)
    assert time < switch <= time + program.cycle + 1e-6
    shown = program.colours(time)
    for share in (0.001, 0.5, 0.999):
        between = time + share * (switch - time)
        if between < switch:
            assert program.colours(between) == shown
            assert program.next_switch(between) == switch
    assert sum(colour is not Colour.RED for colour in shown) <= 1


@given(programs())
def test_a_program_does_not_drift(program: Program) -> None:
    """Waking from switch to switch, the start of each cycle is its number times the cycle."""
    switches, time = [0.0], 0.0
    while time < 50 * program.cycle:
        time = program.next_switch(time)
        switches.append(time)
    green = {time: program.colours(time)[0] is Colour.GREEN for time in switches}
    starts = [later for earlier, later in pairwise(switches) if green[later] > green[earlier]]
    assert starts == [k * program.cycle for k in range(1, len(starts) + 1)]
    assert len(starts) >= 49
