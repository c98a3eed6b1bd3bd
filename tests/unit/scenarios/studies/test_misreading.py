"""Experiments on wrong perception: what is asked for, what is counted, and how sure a rate is."""

from __future__ import annotations

import json
import math

import pytest

from dim import Dim, ExactPerception, NoisyPerception
from dim.senses.tally import Tallied
from minisim import simulate
from minisim.errors import CollisionError, InputError
from scenarios import four_way
from scenarios.cli import main
from scenarios.controllers import controller_named
from scenarios.misreading import counted, with_perception
from scenarios.statistics import poisson_interval

WRONG = NoisyPerception(0.15)


def test_only_vehicles_of_dim_misread() -> None:
    assert with_perception(Dim(gate="harmonious"), WRONG) == Dim("size", gate="harmonious",
                                                                perception=WRONG)  # fmt: skip
    fixed = controller_named("fixed-time")
    assert with_perception(fixed, ExactPerception()) is fixed
    with pytest.raises(InputError, match="can misread each other, not those of 'fixed-time'"):
        with_perception(fixed, WRONG)


def test_what_errs_is_counted() -> None:
    assert counted(Dim(perception=WRONG)) == Tallied(Dim(perception=WRONG))
    assert counted(Dim()) == Dim()
    assert counted(controller_named("adaptive")).name == "adaptive"


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
    assert main([*RUN, "--intent-error", "0.25", "--error-kind", "symmetric"]) == 0
    text = capsys.readouterr().out
    assert "dim-symmetric-0.25" in text
    assert "false grants" in text
    assert main([*RUN, "--json", "-c", "dim-unsignalled"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["crossings"] >= found["trips"] - found["unfinished"]
    assert main(RUN) == 0
    assert "false grants" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--intent-error", "1.5"), "intent_error must be at least 0 and at most 1, got 1.5"),
        (("--intent-error", "nan"), "intent_error must be"),
        (("--error-kind", "mised"), "did you mean 'missed'"),
        (("--error-kind", "symmetric"), "--error-kind symmetric needs --intent-error P above 0"),
        (("-c", "dim-occlusion", "--intent-error", "0.1"), "has a perception of its own"),
        (("--intent-error", "0.1", "-c", "fixed-time"), "not those of 'fixed-time'"),
    ],
)
def test_bad_values_exit_2(capsys: Captured, options: tuple[str, ...], message: str) -> None:
    assert main([*RUN, *options]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("minisim: ")
    assert message in captured.err
    assert captured.err.count("\n") == 1
