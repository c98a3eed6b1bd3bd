"""Runs of a benchmark, the file that holds them, and the comparison of two such files."""

from __future__ import annotations

import json
import math
import os
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from minisim.control import Controller
from minisim.errors import FileError, InputError
from minisim.files import AnyPath, read_file, write_text
from minisim.results.metric import BEGINNINGS
from minisim.version import __version__
from scenarios.benchmark.definition import Benchmark
from scenarios.benchmark.ranking import LEAST, RANKED, chance
from scenarios.optimum import optimum
from scenarios.statistics import Interval, mean_interval
from scenarios.sweep.keys import RESULTS
from scenarios.sweep.rows import Row
from scenarios.sweep.runner import finished
from scenarios.sweep.store import Store

if TYPE_CHECKING:
    import pandas as pd

#: The name of the file in its folder, and the layout of what is in it.
FILE, LAYOUT = "benchmark.json", 1

#: What a row is about.
KEY = ("cell", "controller", "seed")

#: Columns that differ from run to run, or that the head has.
VARIES = ("cpu_s", "median_decision_us", "p99_decision_us", "version", "recipe")

#: Numbers that differ by less are equal: relative to the larger one.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Result:
    """All rows of a benchmark, and what made them."""

    head: Mapping[str, Any]
    rows: pd.DataFrame  #: the columns `KEY`, `error`, and those of a sweep's rows of the whole run

    @property
    def plain(self) -> list[str]:
        """The cells that count for the overall rank."""
        return list(self.head["plain"])


def measured(
    benchmark: Benchmark, controllers: Sequence[tuple[str, Controller]], store: Store, jobs: int,
    progress: Callable[[int, int], None],
) -> Result:  # fmt: skip
    """Run what the store does not have yet; raises `FileError`.

    A controller that cannot serve a cell has rows that say why.
    """
    import pandas as pd

    plan = list(benchmark.runs(controllers))
    recipes = {k: it for k, (*_, it) in enumerate(plan) if not isinstance(it, InputError)}
    places, made = list(recipes), dict[int, Row]()
    for k, row in finished(list(recipes.values()), jobs=jobs, store=store):
        made[places[k]] = row
        progress(len(made), len(recipes))
    rows = []
    for k, (cell, name, seed, it) in enumerate(plan):
        row = made.get(k, {"error": str(it)})
        kept = {key: value for key, value in row.items() if not key.startswith(BEGINNINGS[1:])}
        rows.append({**kept, "cell": cell.name, "controller": name, "seed": seed})
    frame = pd.DataFrame(rows)
    head = {
        "benchmark": benchmark.name, "benchmark_version": benchmark.version,
        "digest": benchmark.digest, "quick": benchmark.quick, "seeds": list(benchmark.seeds),
        "cells": [cell.name for cell in benchmark.cells], "plain": list(benchmark.plain),
        "no_least": _without_least(benchmark, frame),
        "controllers": [name for name, _ in controllers],
        "minisim": __version__, "results": RESULTS, "commit": commit(),
    }  # fmt: skip
    columns = [*KEY, "error", *(c for c in frame if c not in (*KEY, "error"))]
    return Result(head, frame.reindex(columns=columns))


def _without_least(benchmark: Benchmark, rows: pd.DataFrame) -> dict[str, str]:
    """Cells of which no seed has a known least delay, and why."""
    reasons = {}
    for cell in benchmark.cells:
        here = rows[rows["cell"] == cell.name]
        if LEAST not in here or here[LEAST].isna().all():
            try:
                _ = optimum(cell.scenario, benchmark.seeds[0]).bound
                reasons[cell.name] = "no run went well"
            except InputError as error:
                reasons[cell.name] = str(error)
    return reasons


def commit() -> str | None:
    """The commit of the source, with a + if there are changes; None outside a repository."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return None
    asked = ["git", "-C", str(root), "describe", "--always", "--dirty=+", "--abbrev=12"]
    try:
        answer = subprocess.run(asked, capture_output=True, text=True, timeout=10.0, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.strip() or None


def save(result: Result, path: AnyPath) -> None:
    """Write a result, whole or not at all; raises `FileError`."""
    columns = list(result.rows)
    lines = [
        json.dumps([None if _missing(value) else value for value in row], allow_nan=False)
        for row in result.rows.astype(object).itertuples(index=False, name=None)
    ]
    head = json.dumps({"layout": LAYOUT, **result.head, "columns": columns}, ensure_ascii=False)
    write_text(path, f'{head[:-1]},\n"rows": [\n' + ",\n".join(lines) + "\n]}\n")


def load(path: AnyPath) -> Result:
    """Read a result from its file or its folder; raises `FileError`."""
    import pandas as pd

    file = Path(path) / FILE if os.path.isdir(path) else Path(path)
    try:
        data = json.loads(read_file("the result of a benchmark", file))
        if data.pop("layout") != LAYOUT:
            raise ValueError("another version of minisim wrote it")
        frame = pd.DataFrame(data.pop("rows"), columns=data.pop("columns"))
        if not {*KEY, "error", RANKED} <= {*frame} or not data.keys() >= HEAD:
            raise ValueError("columns or keys are missing")
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise FileError(f"{file} is not the result of a benchmark: {error}") from error
    return Result(data, frame)


#: What the head of a result must have.
HEAD = {"benchmark", "benchmark_version", "digest", "quick", "seeds", "cells", "plain",
        "no_least", "controllers", "minisim", "results", "commit"}  # fmt: skip


class Change(NamedTuple):
    """A controller in a cell whose rows differ between two results."""

    cell: str
    controller: str
    columns: tuple[str, ...]  #: that differ
    difference: Interval | None  #: second less first, in the ranked measure
    chance: float | None  #: of a difference so large if there is none


class Comparison(NamedTuple):
    """Two results, row by row."""

    equal: int  #: rows that both have, and that are equal
    common: int  #: rows that both have
    only_first: int
    only_second: int
    changes: tuple[Change, ...]


def compare(first: Result, second: Result) -> Comparison:
    """Compare two results of the same benchmark; `InputError` if it is not the same.

    Times that a decision took are left out: they differ from run to run.
    """
    for key, what in (
        ("benchmark", "benchmarks"), ("benchmark_version", "versions of the benchmark"),
        ("digest", "definitions of the benchmark"), ("quick", "lengths (--quick)"),
    ):  # fmt: skip
        if first.head[key] != second.head[key]:
            raise InputError(
                f"two different {what} cannot be compared: {first.head[key]} and {second.head[key]}"
            )
    one, other = (it.rows.set_index(list(KEY)).sort_index() for it in (first, second))
    common = one.index.intersection(other.index)
    columns = [c for c in map(str, one.columns) if c in other and c not in VARIES]
    differ: dict[tuple[str, str], set[str]] = {}
    uneven = 0
    a, b = (it.loc[common, columns].astype(object).to_numpy().tolist() for it in (one, other))
    for key, left, right in zip(common, a, b, strict=True):
        unlike = {c for c, x, y in zip(columns, left, right, strict=True) if not _same(x, y)}
        if unlike:
            uneven += 1
            differ.setdefault(key[:2], set()).update(unlike)
    changes = tuple(
        _change(cell, name, columns_, one, other) for (cell, name), columns_ in differ.items()
    )
    return Comparison(
        len(common) - uneven, len(common), len(one) - len(common), len(other) - len(common), changes
    )


def _change(
    cell: str, name: str, columns: set[str], one: pd.DataFrame, other: pd.DataFrame
) -> Change:
    first, second = (it[RANKED].xs((cell, name)).astype(float) for it in (one, other))
    gaps = (second - first).dropna().tolist()
    difference = mean_interval(gaps) if gaps else None
    p = chance(gaps) if len(gaps) > 1 else None
    return Change(cell, name, tuple(sorted(columns)), difference, p)


def _same(x: Any, y: Any) -> bool:
    if _missing(x) or _missing(y):
        return _missing(x) and _missing(y)
    if isinstance(x, float) or isinstance(y, float):
        return math.isclose(x, y, rel_tol=ROUNDING, abs_tol=ROUNDING)
    return bool(x == y)


def _missing(value: Any) -> bool:
    return value is None or (isinstance(value, float) and math.isnan(value))
