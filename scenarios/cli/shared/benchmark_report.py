"""Results of a benchmark as tables for a terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rich import box
from rich.table import Table
from rich.text import Text

from minisim.errors import plural
from scenarios.benchmark.ranking import overall, trouble
from scenarios.benchmark.results import Comparison, Result


def benchmark_table(result: Result) -> Table:
    """Overall ranks of a benchmark; the report has the rest."""
    table = Table(box=box.SIMPLE_HEAD)
    for title in ("controller", "rank", "times the least delay", "95 % interval"):
        table.add_column(title, justify="left" if title == "controller" else "right")
    standings = overall(result.rows, result.plain)
    for name, it in standings.items():
        ends = (it.mean.mean, *(it.mean.mean + k * it.mean.half_width for k in (-1.0, 1.0)))
        mean, low, high = map(math.exp, ends)
        interval = "" if math.isnan(low) else f"{low:.2f} to {high:.2f}"
        table.add_row(name, it.words, f"{mean:.2f}", interval)
    for name in result.head["controllers"]:
        if name not in standings:
            rows = result.rows[result.rows["controller"] == name]
            lost = [cell for cell, runs in rows.groupby("cell", sort=False) if trouble(runs)]
            why = f"not served: {', '.join(map(str, lost))}" if lost else "–"
            table.add_row(name, "–", why, "")
    return table


def comparison_parts(first: str, second: str, made: Comparison) -> Iterator[Text | Table]:
    """What two results of a benchmark have in common, and where they differ."""
    yield Text.assemble(("first   ", "bold"), first, ("\nsecond  ", "bold"), second)
    equal = f"{made.equal} of {plural(made.common, 'common row')} are equal"
    alone = [
        f"{plural(count, 'row')} only in the {which}"
        for count, which in ((made.only_first, "first"), (made.only_second, "second"))
        if count
    ]
    yield Text("; ".join([equal, *alone]))
    if not made.changes:
        return
    table = Table(box=box.SIMPLE_HEAD, title="second less first, on common arrivals")
    for title in ("cell", "controller", "delay [s]", "p", "columns that differ"):
        table.add_column(title, justify="right" if title in ("delay [s]", "p") else "left")
    for it in made.changes:
        shown = "–" if it.difference is None else f"{it.difference.mean:+.3f}"
        if it.difference is not None and not math.isnan(it.difference.half_width):
            shown += f" ± {it.difference.half_width:.3f}"
        more = f" and {len(it.columns) - 3} more" if len(it.columns) > 3 else ""
        table.add_row(
            it.cell, it.controller, shown, "–" if it.chance is None else f"{it.chance:.2g}",
            ", ".join(it.columns[:3]) + more,
        )  # fmt: skip
    yield table
