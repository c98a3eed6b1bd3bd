"""Points at which vehicles misread each other, and how sure a rate is."""

from __future__ import annotations

import pandas as pd
import pytest

from dim import Dim, Monitor, NoisyPerception
from dim.senses.intent import RATES
from dim.senses.noise import UNSIGNALLED
from minisim import simulate
from minisim.errors import CollisionError
from scenarios import four_way
from scenarios.statistics import poisson_interval
from scenarios.studies import study_named
from scenarios.studies.shared.effort import Effort
from scenarios.studies.shared.intent_errors import CROSSINGS, MANNERS, IntentErrorPoint, rate_of
from scenarios.sweep.keys import key_of
from scenarios.sweep.rows import outcome_of


def test_a_rate_is_that_of_all_runs_together() -> None:
    rows = pd.DataFrame(
        {"collisions": [3, 2], "crossings": [900.0, 1100.0], "trips": [9, 9], "unfinished": [0, 0]}
    )
    low, high = poisson_interval(5)
    assert CROSSINGS / 2000 == 5.0
    assert rate_of(rows, "collisions") == pytest.approx((25.0, 5.0 * low, 5.0 * high, 2000))


def test_runs_without_tally_have_their_trips() -> None:
    rows = pd.DataFrame({"collisions": [0], "trips": [1010], "unfinished": [10]})
    collisions, grants = rate_of(rows, "collisions"), rate_of(rows, "false_grants")
    assert collisions == grants
    assert collisions is not None
    assert (collisions.crossings, collisions.value) == (1000, 0.0)
    assert rate_of(rows.assign(trips=10), "collisions") is None


def test_the_study_goes_over_rates_kinds_and_manners() -> None:
    cases = [c for c in study_named("perception").points if isinstance(c, IntentErrorPoint)]
    assert len(cases) == len(set(cases)) == 3 + 2 * 2 * 4 * 6 + 2 * 4 + 3
    of_dim = (c for c in cases if c.series == "dim" and c.rate)
    errors = {(c.kind, c.shared, c.persistent, c.rate) for c in of_dim}
    assert len(errors) == 2 * len(MANNERS) * (len(RATES) - 1)
    exact = [c.recipe(1).controller for c in cases if c.perception.period is None]
    assert exact == [Dim(), Dim(monitor=Monitor()), Dim(order="lanes")]
    assert any(c.perception.unsignalled == UNSIGNALLED for c in cases)
    assert len({key_of(c.recipe(1)) for c in cases}) == len(cases)


@pytest.mark.parametrize("name", ["perception", "confidence"])
def test_all_cases_meet_the_same_arrivals_and_count(name: str) -> None:
    runs = [e for _, e in study_named(name).runs(10)]
    assert len(runs) == 5 * len(study_named(name).points)
    assert len({(e.scenario, e.seed) for e in runs}) == 5
    assert {e.on_collision for e in runs} == {"record"}
    assert study_named(name).chosen(Effort.of(quick=True)) == study_named(name).points


def test_a_row_holds_what_was_counted() -> None:
    row, _ = outcome_of(IntentErrorPoint("dim", "symmetric", 0.25).recipe(1, 300.0))
    assert row["controller"] == "dim:perception=noisy(intent_error=0.25,kind=symmetric)"
    assert row["crossings"] > 50
    assert row["false_grants"] > 0
    assert row["disagreement_s"] > 0.0
    assert row["deadlock_s"] == 0.0
    plain, _ = outcome_of(IntentErrorPoint("dim").recipe(1, 60.0))
    assert "crossings" not in plain


def test_the_collision_that_docs_explain() -> None:
    """docs/background/safety.md, "Wrong perception": all but c3 itself take it for c2."""
    scenario = four_way(250, profile="fair")
    with pytest.raises(CollisionError) as caught:
        simulate(scenario, Dim(perception=NoisyPerception(0.15)), 1)
    (collision,) = caught.value.collisions
    assert (collision.time, collision.movements) == (434.4, ("b3", "c3"))
    table = Dim().start(scenario.site(1)).rules.table
    assert [str(m) for m in table.decide(["b3", "c3", "d1"])] == ["c3", "d1"]
    assert [str(m) for m in table.decide(["b3", "c2", "d1"])] == ["b3"]
