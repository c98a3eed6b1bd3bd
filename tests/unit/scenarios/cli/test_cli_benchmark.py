"""`minisim benchmark`: what it writes, what it compares, and what it refuses."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from scenarios.benchmark.results import FILE
from scenarios.cli import main
from tests.unit.scenarios.benchmark.test_results import SMALL
from tests.unit.scenarios.cli.test_cli import Captured, fails, ok


def test_it_measures_ranks_and_continues(tmp_path: Path, capsys: Captured) -> None:
    file, mine, out = tmp_path / "small.toml", tmp_path / "benchmark_rival.py", tmp_path / "out"
    file.write_text(SMALL)
    mine.write_text("from baselines import AllWayStop\n\nclass Mine(AllWayStop):\n    name = 'm'\n")
    asked = ["benchmark", str(file), "-c", "reservation", "--add", f"{mine}:Mine", "--jobs", "1"]
    said = ok(capsys, *asked, "--out", str(out))
    lines = [line.split()[:2] for line in said.splitlines() if line.strip()]
    assert ["reservation", "1"] in lines
    assert ["m", "2"] in lines
    assert "12 rows" in said
    first = json.loads((out / FILE).read_text())
    assert first["controllers"] == ["reservation", "m"]
    ok(capsys, *asked, "--out", str(out))
    assert json.loads((out / FILE).read_text()) == first  # CPU times too: nothing was run
    assert "12 of 12 common rows are equal" in ok(
        capsys, "benchmark", "--compare", str(out), str(out / FILE)
    )

    first["rows"][-1][first["columns"].index("delay_s")] += 1.0
    other = tmp_path / "other.json"
    other.write_text(json.dumps(first))
    assert main(["benchmark", "--compare", str(out), str(other)]) == 1
    said = capsys.readouterr().out
    assert "11 of 12 common rows are equal" in said
    assert "+0.500 ± 6.353" in said


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("-c", "dimm"), "did you mean 'dim'"),
        (("-c", "dim", "-c", "dim"), "--controller dim is given twice"),
        (("--add", "dim"), "two controllers are called dim"),
        (("nowhere.toml",), "cannot read the benchmark from nowhere.toml"),
        (("--jobs", "0"), "--jobs must be an integer 1 … 1024"),
        (("--out", "/dev/null/x"), "cannot write to folder /dev/null/x"),
        (("--compare", "nowhere", "nowhere"), "cannot read the result of a benchmark from nowhere"),
        (("--compare", "a", "b", "--quick", "-c", "dim"), "so --controller and --quick cannot be"),
    ],
)
def test_bad_input_gives_one_sentence(
    capsys: Captured, arguments: tuple[str, ...], why: str
) -> None:
    assert why in fails(capsys, "benchmark", *arguments)


@pytest.mark.slow
def test_a_quick_benchmark_takes_less_than_a_minute_and_gives_the_same_twice(
    tmp_path: Path, capsys: Captured
) -> None:
    began = time.process_time()
    ok(capsys, "benchmark", "--quick", "--jobs", "1", "--out", str(tmp_path / "one"))
    assert time.process_time() - began < 120.0  # of one process; two halve it
    ok(capsys, "benchmark", "--quick", "--jobs", "1", "--out", str(tmp_path / "two"))
    said = ok(capsys, "benchmark", "--compare", str(tmp_path / "one"), str(tmp_path / "two"))
    rows = json.loads((tmp_path / "one" / FILE).read_text())["rows"]
    assert f"{len(rows)} of {len(rows)} common rows are equal" in said
