"""Experiments on wrong perception: what is asked for, what is counted, and how sure a rate is."""

from __future__ import annotations

import json
import math

import pandas as pd
import pytest

from dim import Dim, Monitor, NoisyPerception
from dim.senses.intent import RATES
from dim.senses.noise import UNSIGNALLED
from minisim import simulate
from minisim.errors import CollisionError, InputError
from scenarios import four_way
from scenarios.cli import main
from scenarios.statistics import poisson_interval
from scenarios.studies.misreading import CROSSINGS, MANNERS, Misreading, rate_of
from scenarios.studies.results import Effort
from scenarios.studies.study import STUDIES
from scenarios.sweep.keys import key_of
from scenarios.sweep.rows import outcome_of

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


def test_a_rate_is_that_of_all_runs_together() -> None:
    rows = pd.DataFrame(
        {"collisions": [3, 2], "crossings": [900.0, 1100.0], "trips": [9, 9], "unfinished": [0, 0]}
    )
    rate = rate_of(rows, "collisions")
    assert rate is not None
    low, high = poisson_interval(5)
    assert rate == pytest.approx((25.0, 5.0 * low, 5.0 * high, 5, 2000))
    assert rate.rate == 5 * CROSSINGS / 2000


def test_runs_without_tally_have_their_trips() -> None:
    rows = pd.DataFrame({"collisions": [0], "trips": [1010], "unfinished": [10]})
    collisions, grants = rate_of(rows, "collisions"), rate_of(rows, "false_grants")
    assert collisions == grants
    assert collisions is not None
    assert (collisions.crossings, collisions.rate) == (1000, 0.0)
    assert rate_of(rows.assign(trips=10), "collisions") is None


# --- studies ---------------------------------------------------------------------------------


def test_the_study_goes_over_rates_kinds_and_manners() -> None:
    cases = [c for c in STUDIES["perception"].cases if isinstance(c, Misreading)]
    assert len(cases) == len(set(cases)) == 3 + 2 * 2 * 4 * 6 + 2 * 4 + 3
    found = {
        (c.kind, c.shared, c.persistent, c.rate) for c in cases if c.series == "dim" and c.rate
    }
    assert len(found) == 2 * len(MANNERS) * (len(RATES) - 1)
    exact = [c.experiment(1).controller for c in cases if c.perception.period is None]
    assert exact == [Dim(), Dim(monitor=Monitor()), Dim(order="lanes")]
    assert any(c.perception.unsignalled == UNSIGNALLED for c in cases)
    keys = {key_of(c.experiment(1)) for c in cases}
    assert len(keys) == len(cases)


@pytest.mark.parametrize("name", ["perception", "confidence"])
def test_all_cases_meet_the_same_arrivals_and_count(name: str) -> None:
    runs = [e for _, e in STUDIES[name].runs(10)]
    assert len(runs) == 5 * len(STUDIES[name].cases)
    assert len({(e.scenario, e.seed) for e in runs}) == 5
    assert {e.on_collision for e in runs} == {"record"}
    assert Effort.quick().cases(STUDIES[name]) == STUDIES[name].cases


def test_a_row_holds_what_was_counted() -> None:
    row, _ = outcome_of(Misreading("dim", "symmetric", 0.25).experiment(1, 300.0))
    assert row["controller"] == "dim:perception=noisy(intent_error=0.25,kind=symmetric)"
    assert row["crossings"] > 50
    assert row["false_grants"] > 0
    assert row["disagreement_s"] > 0.0
    assert row["deadlock_s"] == 0.0
    plain, _ = outcome_of(Misreading("dim").experiment(1, 60.0))
    assert "crossings" not in plain


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
