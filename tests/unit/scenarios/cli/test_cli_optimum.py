import json

import pytest

from scenarios.cli import main

SHORT = ("three-way", "-p", "fair", "-d", "200", "--horizon", "60")


def test_it_prints_the_bound_the_schedule_and_each_controller(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["optimum", *SHORT, "-c", "reservation", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    schedule, reservation = told["controllers"]
    assert 0.0 < told["bound_s"] <= told["planned_s"] <= schedule["delay_s"]
    assert told["reached_s"] == pytest.approx(told["bound_s"], rel=1e-5)
    assert reservation["controller"] == "reservation"
    assert reservation["above_percent"] == pytest.approx(
        100.0 * (reservation["delay_s"] / told["bound_s"] - 1.0)
    )
    assert main(["optimum", *SHORT, "-c", "reservation"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert f"{told['vehicles']} vehicles" in lines[0]
    bound = next(line for line in lines if line.startswith("  bound"))
    assert bound.split() == ["bound", f"{told['bound_s']:.3f}"]


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("-p", "as_run"), "model 'cc'"),
        (("--host", "sumoo"), "did you mean 'sumo'"),
        (("-c", "dim", "-c", "dim"), "--controller dim is given twice"),
    ],
)
def test_bad_input_gives_one_sentence(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], why: str
) -> None:
    assert main(["optimum", "three-way", *arguments]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert why in told
