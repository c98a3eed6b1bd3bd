"""Results as tables for a terminal."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich import box
from rich.table import Table
from rich.text import Text

from minisim.results.metrics import METRICS, SPREAD, Metric, heading
from minisim.results.summary import GROUPS
from scenarios.statistics import FILLING

if TYPE_CHECKING:
    import pandas as pd

    from figures.studies.shared.section import Item
    from scenarios.recipe import Recipe

#: Closest calls that every run of the command line shows.
CLOSEST = ("min_ttc_s", "min_pet_s")

#: Columns of the table of a run, and of that of a sweep, where no others are asked for.
RUN_COLUMNS = ("waiting_time_s", "travel_time_s", "depart_delay_s")
CELL_COLUMNS = (
    "waiting_time_s",
    "complete_waiting_time_s",
    "travel_time_s",
    "complete_depart_delay_s",
)


def run_title(summary: Mapping[str, Any]) -> Text:
    """What was run."""
    return Text.assemble(
        (f"{summary['scenario']}, {summary['controller']}", "bold"),
        f": {summary['density']:g} veh/h/lane, profile {summary['profile']}, "
        f"seed {summary['seed']}, {summary['horizon_s']:g} s",
        f" after a warm-up of {summary['warmup_s']:g} s" if summary["warmup_s"] else "",
        "" if summary["host"] == "minisim" else f", host {summary['host']}",
    )


def run_table(
    summary: Mapping[str, Any], metrics: Sequence[Metric] = (), by: str = "lane"
) -> Table:
    """Means of one run by group and in total, of the metrics that were asked for or of the usual.

    Metrics that were asked for have their percentiles too.
    """
    columns = _run_columns(metrics)
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column(by)
    for title in ("served", "unfinished", *columns.values()):
        table.add_column(title, justify="right")
    groups = list(summary.get(GROUPS[by], {}).items())
    for k, (name, means) in enumerate(groups, start=1):
        table.add_row(name, *_counts(means), *_means(means, columns), end_section=k == len(groups))
    table.add_row("all", *_counts(summary), *_means(summary, columns), style="bold")
    table.add_row("with unfinished", "", "", *_means(summary["complete"], columns), style="dim")
    if by != "kind":
        for name, means in summary.get("kinds", {}).items():
            table.add_row(name, *_counts(means), *_means(means, columns))
    return table


def _run_columns(metrics: Sequence[Metric]) -> dict[str, str]:
    """Column of a group of trips -> heading."""
    columns = {}
    for metric in metrics:
        if metric.grouped and metric.name not in ("trips", "unfinished"):
            columns[metric.name] = metric.heading
        if metric.per == "trip":
            columns |= {f"{metric.name}_{what}": what for what in SPREAD}
    return columns or {name: METRICS[name].heading for name in RUN_COLUMNS}


def number_lines(summary: Mapping[str, Any], metrics: Iterable[Metric]) -> Iterator[Text]:
    """What was asked for and has one number a run only."""
    for metric in metrics:
        if metric.per == "run" and not metric.grouped:
            value = summary[metric.name]
            shown = "–" if value is None else f"{value:g} {metric.unit}".rstrip()
            yield Text.assemble(f"  {metric.title or metric.name} ", (shown, "bold"))


def metrics_table(metrics: Iterable[Metric]) -> Table:
    """What is measured, in what unit and by which equation."""
    table = Table(box=box.SIMPLE_HEAD)
    for title in ("name", "unit", "per", "needs", "meaning", "equation"):
        table.add_column(title, no_wrap=title == "name")
    for metric in metrics:
        equation = " = ".join(filter(None, (metric.symbol, metric.equation)))
        table.add_row(metric.name, metric.unit, metric.per, metric.needs, metric.meaning, equation)
    return table


def safety_line(summary: Mapping[str, Any]) -> Text:
    """Collisions and, where measured, the closest calls of one run."""
    collisions = summary["collisions"]
    line = Text.assemble(
        "  collisions ", (str(collisions), "bold red" if collisions else "bold green")
    )
    for name in CLOSEST:
        if name in summary:
            metric = METRICS[name]
            line.append(f"   {metric.title} ")
            line.append(_seconds(summary[name], f" {metric.unit}"), "bold")
    return line


def tally_line(counts: Mapping[str, float]) -> Iterable[Text]:
    """What wrong perception did, where it was counted (`dim.senses.tally`)."""
    if counts:
        yield Text(
            f"  crossings {counts['crossings']:g}   false grants {counts['false_grants']:g}   "
            f"disagreement {counts['disagreement_s']:.1f} s   "
            f"deadlock {counts['deadlock_s']:.1f} s"
        )


def gallery_table(items: Iterable[Item]) -> Table:
    """Names and titles of figures and tables, and the studies that they need."""
    table = Table(box=box.SIMPLE_HEAD)
    for title in ("name", "what", "studies"):
        table.add_column(title)
    for item in items:
        table.add_row(item.name, item.title, ", ".join(item.needs) or "none")
    return table


def sweep_table(cells: pd.DataFrame) -> Table:
    """One line a cell: means over seeds with 95 % confidence intervals."""
    table = Table(box=box.SIMPLE_HEAD)
    for title in ("scenario", "profile", "split", "veh/h/lane", "controller"):
        table.add_column(title, no_wrap=True)
    headings = map(heading, CELL_COLUMNS)
    for title in ("runs", *headings, "unfinished", "collisions", ""):
        table.add_column(title, justify="right", no_wrap=True)
    for cell in cells.to_dict("records"):
        named = (cell["scenario"], cell["profile"], cell["split"], f"{cell['density']:g}")
        failed = f" (+{cell['failed']} failed)" if cell["failed"] else ""
        if cell["runs"]:
            collisions = int(cell["collisions"])
            table.add_row(
                *named,
                cell["controller"],
                f"{cell['runs']}{failed}",
                *(_interval(cell, metric) for metric in CELL_COLUMNS),
                f"{cell['unfinished'] / cell['trips']:.0%}" if cell["trips"] else "–",
                Text(str(collisions), style="bold red" if collisions else ""),
                Text(_settled(cell), style="yellow"),
            )
        else:
            table.add_row(*named, cell["controller"], f"0{failed}", style="red")
    return table


def _settled(cell: Mapping[Hashable, Any]) -> str:
    """Whether queues had settled, where they had not."""
    return "too short" if cell["too_short"] else "growing" if cell["growing"] else ""


def sweep_notes(rows: pd.DataFrame, cells: pd.DataFrame, experiments: Sequence[Recipe]) -> Text:
    """What to know of the table: growing queues, capped signals, the first failure."""
    text = Text()
    if "too_short" in cells and cells["too_short"].eq(True).any():
        text.append(
            "  too short: the roads were still filling, so that nothing can be said of queues; "
            f"simulate {FILLING:g} travel times or more.\n"
        )
    if "growing" in cells and cells["growing"].eq(True).any():
        text.append(
            "  growing: queues had not settled by the horizon; a mean delay there says how long "
            "was simulated.\n"
        )
    for note in _capped(experiments):
        text.append(f"  {note}\n")
    failures = rows[rows["error"].notna()]
    if len(failures):
        first = failures.iloc[0]
        text.append(
            f"  {len(failures)} of {len(rows)} runs failed; the first ({first['controller']}, "
            f"{first['scenario']}, {first['density']:g} veh/h/lane, seed {first['seed']}): "
            f"{first['error']}\n",
            "red",
        )
    text.rstrip()
    return text


def _capped(experiments: Sequence[Recipe]) -> list[str]:
    """A line for each signal whose demand is beyond Webster's formula."""
    from baselines import FixedTime

    notes: dict[str, None] = {}
    for experiment in experiments:
        signal, scenario = experiment.controller, experiment.scenario
        if isinstance(signal, FixedTime) and signal.timing(scenario.site()).capped:
            notes[
                f"{experiment.name}, {scenario.name}, {scenario.density:g} veh/h/lane: the demand "
                f"is over Webster's capacity; the cycle is capped at {signal.max_cycle:g} s."
            ] = None
    return list(notes)


def _interval(cell: Mapping[Hashable, Any], metric: str) -> str:
    from scenarios.statistics import Interval

    mean = cell.get(metric)
    if mean is None or mean != mean:
        return "–"
    return str(Interval(mean, cell[f"{metric}_ci95"], cell["runs"]))


def _counts(means: Mapping[str, Any]) -> tuple[str, str]:
    return str(means["trips"] - means["unfinished"]), str(means["unfinished"])


def _means(means: Mapping[str, Any], columns: Iterable[str]) -> list[str]:
    return [_seconds(means[key]) if key in means else "" for key in columns]


def _seconds(value: float | None, unit: str = "") -> str:
    return "–" if value is None else f"{value:.2f}{unit}"
