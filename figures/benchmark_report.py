"""The page of a benchmark, and its tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from figures import style
from figures.benchmark import (
    cells_figure,
    label,
    measures_figure,
    names,
    overall_figure,
    per_trip,
    times,
    titled,
)
from figures.tables import Table
from minisim.files import make_folder, write_table, write_text
from minisim.results.metrics import METRICS
from scenarios.benchmark.definition import MEASURED, SCHEDULE
from scenarios.benchmark.ranking import (
    RANKED,
    Standing,
    by_cell,
    groups,
    overall,
    ranked,
    scores,
    trouble,
)
from scenarios.benchmark.results import FILE, Result, save
from scenarios.statistics import Interval, mean_interval


def write_page(
    result: Result, folder: Path, facts: str, progress: Callable[[int, int], None]
) -> None:
    """Write benchmark.json, report.md, cells.csv and the figures into a folder; `FileError`."""
    pictures = make_folder(folder / "figures")
    save(result, folder / FILE)
    write_table(means(result), folder / "cells.csv")
    drawings = {"cells": cells_figure}
    if scores(result.rows, result.plain):
        drawings = {"overall": overall_figure, **drawings, "measures": measures_figure}
    for done, (name, draw) in enumerate(drawings.items(), start=1):
        style.save(draw(result), pictures / f"{name}.png")
        progress(done, len(drawings))
    text = "\n\n".join(_report(result, facts, drawings))
    write_text(folder / "report.md", text.rstrip() + "\n")


def means(result: Result) -> pd.DataFrame:
    """Mean and half width of the 95 % interval of every measure, by cell and controller."""
    columns = [it if isinstance(it, str) else it.name for it in MEASURED]
    rows = per_trip(result.rows)
    known = map(str, rows.columns)
    wanted = [c for c in known if c.removeprefix("complete_").startswith(tuple(columns))]
    made = []
    for cell, name, runs in groups(rows):
        line: dict[str, Any] = {"cell": cell, "controller": name, "trouble": trouble(runs)}
        for column in wanted:
            values = pd.to_numeric(runs[column], errors="coerce").dropna().tolist()
            if values:
                interval = mean_interval(values)
                line |= {column: interval.mean, f"{column}_ci95": interval.half_width}
        made.append(line)
    return pd.DataFrame(made)


def _report(result: Result, facts: str, drawn: Iterable[str]) -> Iterator[str]:
    head, standings = result.head, overall(result.rows, result.plain)
    yield f"# {titled(result, 'results')}"
    if head["quick"]:
        yield "**A smoke test: few and short runs. Its numbers mean nothing.**"
    yield (
        f"minisim {head['minisim']}, results {head['results']}, commit "
        f"{head['commit'] or 'unknown'}; definition {head['digest']}; seeds "
        f"{', '.join(map(str, head['seeds']))}. {facts}"
    )
    yield (
        "All controllers have the same arrivals. A run goes on until its last vehicle has arrived, "
        "and every vehicle counts. The least delay is a bound that no controller can beat "
        "(docs/howto/optimum.md); the schedule knows all arrivals beforehand. "
        f"`{FILE}` has every row: compare it with another one by `minisim benchmark --compare`."
    )
    for cell, why in head["no_least"].items():
        yield f"The least delay of the cell {cell} is not known: {why}."
    for name in drawn:
        yield f"![{name}](figures/{name}.png)"
    yield _overall_table(standings).markdown()
    yield _rank_table(result).markdown()
    yield _trouble_table(result).markdown()


def _overall_table(standings: Mapping[str, Standing]) -> Table:
    def interval(it: Interval) -> str:
        low, _, high = times(it)
        return f"{low:.2f} to {high:.2f}" if it.size > 1 else "–"

    return Table(
        "Times the least delay, geometric mean over the cells without errors, lost messages and "
        "humans",
        ("controller", "rank", "times the least", "95 % interval"),
        tuple(
            (label(name), it.words, f"{math.exp(it.mean.mean):.2f}", interval(it.mean))
            for name, it in standings.items()
        ),
        notes=(
            "In brackets the ranks that are possible: paired t-tests on common arrivals, with "
            "Holm's correction, 95 % confidence for all ranks together.",
        ),
    )  # fmt: skip


def _rank_table(result: Result) -> Table:
    known = by_cell(result.rows)
    standings = {
        cell: ranked({name: it for name, it in known.get(cell, {}).items() if name != SCHEDULE})
        for cell in result.head["cells"]
    }
    order = [name for name in names(result) if name != SCHEDULE]

    def shown(cell: str, name: str) -> str:
        it = standings[cell].get(name)
        return f"{it.mean.mean:.1f}, {it.words}" if it else "×"

    return Table(
        "Mean delay [s] and rank in each cell, with the ranks that are possible",
        ("controller", *standings),
        tuple((label(name), *(shown(cell, name) for cell in standings)) for name in order),
        notes=(f"Ranked by {METRICS.get(RANKED, RANKED)}; least is best.",),
    )


def _trouble_table(result: Result) -> Table:
    rows = tuple(
        (cell, label(name), why)
        for cell, name, runs in groups(result.rows)
        if (why := trouble(runs))
    )
    return Table("Not counted", ("cell", "controller", "why"), rows, labels=3)
