"""Experiments on wrong perception: what is asked for, what is counted, and how sure a rate is."""

from __future__ import annotations

import json
import math

import pytest

from dim import Dim, NoisyPerception
from minisim import simulate
from minisim.errors import CollisionError, InputError
from scenarios import four_way
from scenarios.cli import main
from scenarios.statistics import poisson_interval

WRONG = NoisyPerception(0.15)


# --- rates -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("count", "low", "high"),
    [(0, 0.0, 3.6889), (1, 0.0253, 5.5716), (5, 1.6235, 11.6683), (10, 4.7954, 18.3904),
     (100, 81.364, 121.627)],
)  # fmt: skip
def test_poisson_interval_of_the_tables(count: int, low: float, high: float) -> None:
    """Garwood's limits, from tables of χ²: χ²(2k; 0.025)/2 and χ²(2k+2; 0.975)/2."""
    assert poisson_interval(count) == pytest.approx((low, high), abs=5e-4)


def test_poisson_interval_by_its_definition() -> None:
    """At the upper limit so few events have probability 0.05, at the lower so many."""
    low, high = poisson_interval(7, 0.9)

    def at_most(k: int, mean: float) -> float:
        return sum(math.exp(-mean) * mean**i / math.factorial(i) for i in range(k + 1))

    assert at_most(7, high) == pytest.approx(0.05)
    assert 1.0 - at_most(6, low) == pytest.approx(0.05)
    with pytest.raises(InputError, match="count must be an integer of at least 0"):
        poisson_interval(-1)
    with pytest.raises(InputError, match="confidence must be"):
        poisson_interval(1, 1.0)


def test_the_collision_that_docs_explain() -> None:
    """docs/safety.md, "Wrong perception": all but c3 itself take it for c2."""
    scenario = four_way(250, profile="fair")
    with pytest.raises(CollisionError) as caught:
        simulate(scenario, Dim(perception=WRONG), 1)
    (collision,) = caught.value.collisions
    assert (collision.time, collision.movements) == (662.8, ("c3", "b3"))
    table = Dim().start(scenario.site(1)).rules.table
    assert [str(m) for m in table.decide(["b3", "c3", "d1"])] == ["c3", "d1"]
    assert [str(m) for m in table.decide(["b3", "c2", "d1"])] == ["b3"]


# --- the command line ------------------------------------------------------------------------

Captured = pytest.CaptureFixture[str]
RUN = ("run", "four-way", "--density", "250", "--profile", "fair", "--horizon", "300",
       "--no-safety", "--on-collision", "record")  # fmt: skip


def test_one_run_tells_what_was_counted(capsys: Captured) -> None:
    assert main([*RUN, "-c", "dim:perception=noisy(intent_error=0.15,kind=symmetric)"]) == 0
    assert "false grants" in capsys.readouterr().out
    assert main([*RUN, "--json", "-c", "dim:perception=noisy(unsignalled=(0.29,0.25))"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["crossings"] >= found["trips"] - found["unfinished"]
    assert main(RUN) == 0
    assert "false grants" not in capsys.readouterr().out
