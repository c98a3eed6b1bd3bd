"""The benchmark works; times are for `make bench`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.bench import bench


def test_a_taste_of_the_benchmark(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept = tmp_path / "speed.jsonl"
    kept.write_text("{}\n")
    bench.main(["--quick", "--append", str(kept)])
    head, *table = capsys.readouterr().out.splitlines()
    assert "cores" in head
    first, line = map(json.loads, kept.read_text().splitlines())
    assert first == {}
    assert {"date", "commit", "processor"} < line.keys()
    figures = {key: value for key, value in line.items() if key.endswith(("_s", "_ns", "_ms"))}
    assert len(figures) >= 5
    assert all(value > 0.0 for value in figures.values())
    assert len(table) >= len(figures)
