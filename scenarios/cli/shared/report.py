"""Results as tables for a terminal."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich import box
from rich.table import Table
from rich.text import Text

from minisim.clock import time_of_day
from minisim.errors import plural
from minisim.junction.movements import ARM_NAMES
from minisim.results.asked import asked_metrics
from minisim.results.metric import GROUPS, SPREAD, Metric
from minisim.results.metrics import METRICS, heading
from minisim.results.show import conditions, spilled
from scenarios.statistics import FILLING, Interval
from scenarios.sweep.cells import SUMS

if TYPE_CHECKING:
    import pandas as pd

    from figures.studies.shared.section import Item
    from minisim.counts import Count
    from scenarios.optimum import Optimum
    from scenarios.recipe import Recipe

#: The closest calls, which are printed for every run.
CLOSEST = ("min_ttc_s", "min_pet_s")

#: Columns of the tables of a run and of a sweep, unless others are asked for.
RUN_COLUMNS = ("waiting_time_s", "travel_time_s", "depart_delay_s")
CELL_COLUMNS = (
    "waiting_time_s", "complete_waiting_time_s", "travel_time_s", "complete_depart_delay_s",
)  # fmt: skip

#: Further columns that may tell cells of a sweep apart.
APART = ("side", "fleet", "turns", "horizon_s", "warmup_s")


def run_parts(
    summary: Mapping[str, Any], metrics: Sequence[Metric], by: str, counts: Mapping[str, float],
    inflow: str = "",
) -> Iterator[Text | Table]:  # fmt: skip
    """What was run, its table, the `dim.senses.tally` counts, and metrics of the whole run.

    `inflow` says the inflow in the unit in which it was given, if that is not veh/h/lane.
    """
    what = f"{summary['scenario']}, {summary['controller']}"
    yield Text.assemble((what, "bold"), f": {conditions(summary, inflow)}")
    yield _run_table(summary, metrics, by)
    if told := spilled(summary):
        yield Text(f"  {told}", "yellow")
    yield _safety(summary)
    if counts:
        yield Text("  " + "   ".join(_counted(name, value) for name, value in counts.items()))
    for metric in metrics:
        if metric.grouped or metric.name in {"collisions", *CLOSEST, *counts}:
            continue
        value = summary[metric.name]
        why = " (counted only where perception errs)" if metric.needs == "counts" else ""
        shown = f"–{why}" if value is None else f"{value:g} {metric.unit}".rstrip()
        yield Text.assemble(f"  {metric.title or metric.name} ", (shown, "bold"))


def _counted(name: str, value: float) -> str:
    metric = METRICS.get(name)
    return (
        f"{metric.title} {value:g} {metric.unit}".rstrip()
        if metric
        else f"{name.replace('_', ' ')} {value:g}"
    )


def _run_table(summary: Mapping[str, Any], metrics: Sequence[Metric], by: str) -> Table:
    """Means by group and in total, for the requested metrics or else the usual ones."""
    columns = _columns(metrics, RUN_COLUMNS)
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


def _columns(metrics: Iterable[Metric], usual: Iterable[str]) -> dict[str, str]:
    """Column of a group of trips -> heading, of metrics with their percentiles or the usual ones.

    Unfinished trips have a column in any case.
    """
    columns = {}
    for metric in metrics:
        if metric.grouped and metric.name != "unfinished":
            columns[metric.name] = metric.heading
        if metric.per != "run":
            columns |= {f"{metric.name}_{what}": what for what in SPREAD}
    return columns or {name: heading(name) for name in usual}


def _safety(summary: Mapping[str, Any]) -> Text:
    collisions = summary["collisions"]
    line = Text("  collisions ").append(str(collisions), "bold red" if collisions else "bold green")
    for metric in (METRICS[name] for name in CLOSEST if name in summary):
        value = _seconds(summary[metric.name], f" {metric.unit}")
        line.append(f"   {metric.title} ").append(value, "bold")
    return line


def optimum_parts(
    what: str, least: Optimum, rows: Iterable[Mapping[str, Any]]
) -> Iterator[Text | Table]:
    """The bound, the schedule, and how far each controller is above."""
    from scenarios.optimum import above

    yield Text.assemble((what, "bold"), f": {least.vehicles} vehicles, mean delay")
    table = Table(box=box.SIMPLE_HEAD)
    for title in ("", "delay [s]", "above the bound [%]"):
        table.add_column(title, justify="right" if title else "left")
    table.add_row("bound", f"{least.bound:.3f}", "", style="bold")
    for name, delay in (
        ("best order by the bound's rules", least.reached), ("schedule, as planned", least.planned)
    ):  # fmt: skip
        percent = above(delay, least.bound)
        told = {"controller": name, "delay_s": delay, "above_percent": percent}
        table.add_row(*_above(told))
    for k, row in enumerate(rows):
        schedule = {"controller": "schedule, as driven"} if k == 0 else {}
        table.add_row(*_above({**row, **schedule}), end_section=k == 0)
    yield table
    for row in rows:
        if row["error"]:
            yield Text(f"  {row['controller']}: {row['error']}", "yellow")


def _above(row: Mapping[str, Any]) -> tuple[str, str, str]:
    delay, above = row["delay_s"], row["above_percent"]
    shown = "–" if delay is None else f"{delay:.3f}"
    return row["controller"], shown, "–" if above is None else f"{above:.1f}"


def gallery_table(items: Iterable[Item]) -> Table:
    """Names and titles of figures and tables, and the studies that they need."""
    table = Table(box=box.SIMPLE_HEAD)
    for title in ("name", "what", "studies"):
        table.add_column(title)
    for item in items:
        table.add_row(item.name, item.title, ", ".join(item.needs) or "none")
    return table


def sweep_table(cells: pd.DataFrame, experiments: Iterable[Recipe]) -> Table:
    """One line per cell: means over seeds with 95 % confidence intervals.

    The columns are the usual ones, or else the metrics asked for, and whatever tells cells apart.
    """
    asked = {it.name: it for recipe in experiments for it in asked_metrics(recipe.metrics)}
    columns = _columns(asked.values(), CELL_COLUMNS)
    columns |= {it.name: it.heading for it in asked.values() if not it.grouped}
    columns.pop("collisions", None)
    apart = [name for name in APART if cells[name].nunique() > 1]
    table = Table(box=box.SIMPLE_HEAD)
    for title in ("scenario", "profile", "split", *apart, "veh/h/lane", "controller"):
        table.add_column(title, no_wrap=True)
    for title in ("runs", *columns.values(), "unfinished", "collisions", ""):
        table.add_column(title, justify="right", no_wrap=True)
    for cell in cells.to_dict("records"):
        parts = (cell[name] for name in ("scenario", "profile", "split", *apart, "density"))
        named = [part if isinstance(part, str) else f"{part:g}" for part in parts]
        failed = f" (+{cell['failed']} failed)" if cell["failed"] else ""
        named += [cell["controller"], f"{cell['runs']}{failed}"]
        if not cell["runs"]:
            table.add_row(*named, style="red")
            continue
        means = (_interval(cell, column) for column in columns)
        unfinished = f"{cell['unfinished'] / cell['trips']:.0%}" if cell["trips"] else "–"
        collisions = Text(f"{cell['collisions']:.0f}", "bold red" if cell["collisions"] else "")
        unsettled = "too short" if cell["too_short"] else "growing" if cell["growing"] else ""
        unsettled += f"{', ' * bool(unsettled)}spill-back" if cell["spillback"] else ""
        table.add_row(*named, *means, unfinished, collisions, Text(unsettled, "yellow"))
    return table


def sweep_notes(rows: pd.DataFrame, cells: pd.DataFrame, experiments: Sequence[Recipe]) -> Text:
    """What to know about the table: growing queues, capped signals, the first failure."""
    meanings = {
        "too_short": "too short: the roads were still filling, so nothing can be said of queues; "
        f"simulate {FILLING:g} travel times or more.",
        "growing": "growing: queues had not settled by the horizon; a mean delay there says how "
        "long was simulated.",
        "spillback": "spill-back: in a run or more, a queue reached the end of its road; vehicles "
        "then wait before it (departure delay), not on it.",
    }
    notes = [text for key, text in meanings.items() if key in cells and cells[key].eq(True).any()]
    text = Text("\n").join(Text(f"  {note}") for note in (*notes, *_capped(experiments)))
    failures = rows[rows["error"].notna()]
    if len(failures):
        first = failures.iloc[0]
        what = f"{first['controller']}, {first['scenario']}, {first['density']:g} veh/h/lane"
        told = f"the first ({what}, seed {first['seed']}): {first['error']}"
        text.append("\n" if text else "")
        text.append(f"  {len(failures)} of {plural(len(rows), 'run')} failed; {told}", "red")
    return text


def _capped(experiments: Sequence[Recipe]) -> Iterable[str]:
    """A line for each signal with a demand over Webster's capacity."""
    from baselines import FixedTime

    return dict.fromkeys(
        f"{experiment.name}, {scenario.name}, {scenario.density:g} veh/h/lane: the demand is over "
        f"Webster's capacity; the cycle is capped at {signal.max_cycle:g} s."
        for experiment in experiments
        for signal, scenario in [(experiment.controller, experiment.scenario)]
        if isinstance(signal, FixedTime)
        and any(it.capped for it in signal.timings(scenario.site()))
    )


def _interval(cell: Mapping[Hashable, Any], metric: str) -> str:
    mean = cell.get(metric)
    if mean is None or mean != mean:
        return "–"
    if metric in SUMS:
        return str(mean)
    return str(Interval(mean, cell[f"{metric}_ci95"], cell["runs"]))


def _counts(means: Mapping[str, Any]) -> tuple[str, str]:
    return str(means["trips"] - means["unfinished"]), str(means["unfinished"])


def _means(means: Mapping[str, Any], columns: Iterable[str]) -> list[str]:
    return [_shown(key, means[key]) if key in means else "" for key in columns]


def _shown(name: str, value: float | None) -> str:
    grades = METRICS[name].grades if name in METRICS else ""
    return grades[int(value) - 1] if grades and value else _seconds(value)


def _seconds(value: float | None, unit: str = "") -> str:
    return "–" if value is None else f"{value if isinstance(value, int) else f'{value:.2f}'}{unit}"


def count_facts(count: Count) -> dict[str, Any]:
    """What was understood of a count, and what was left out."""
    movements = {
        f"{lane}{turn}": total
        for lane, row in zip(ARM_NAMES, count.vehicles.sum((0, 3)).tolist(), strict=False)
        for turn, total in enumerate(row, start=1)
    }
    return {
        "arms": dict(zip(ARM_NAMES, count.arms, strict=False)),
        "intervals": len(count.edges) - 1,
        "from": time_of_day(count.edges[0]),
        "until": time_of_day(count.edges[-1]),
        "vehicles": float(count.vehicles.sum()),
        "movements": movements,
        "types": dict(zip(count.types, count.vehicles.sum((0, 1, 2)).tolist(), strict=True)),
        "classes": dict(count.classes),
        "fleet": count.fleet,
        "mix": count.mix,
        "left_out": dict(count.left_out),
        "notes": list(count.notes),
    }


def count_parts(count: Count) -> Iterator[Text | Table]:
    """The same as text: sums by arm and movement, by class, and what was left out."""
    facts = count_facts(count)
    yield Text.assemble(
        (count.name, "bold"), f": {facts['vehicles']:g} vehicles, {facts['from']}-{facts['until']},"
        f" {plural(facts['intervals'], 'interval')}",
    )  # fmt: skip
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("lane")
    table.add_column("arm")
    for turn in range(1, len(count.arms)):
        table.add_column(f"manoeuvre {turn}", justify="right")
    table.add_column("all", justify="right")
    for lane, arm in facts["arms"].items():
        row = [facts["movements"][f"{lane}{turn}"] for turn in range(1, len(count.arms))]
        table.add_row(lane, arm, *(f"{total:g}" for total in (*row, sum(row))))
    yield table
    for kind, total in facts["types"].items():
        said = ", ".join(name for name, it in count.classes.items() if it == kind)
        yield Text(f"  {kind} ({said}): {total:g}")
    yield Text.assemble("  over all lanes: --fleet ", (count.mix, "bold"))
    for what, total in facts["left_out"].items():
        yield Text(f"  left out: {total:g} {what}", "yellow")
    for note in facts["notes"]:
        yield Text(f"  {note}", "dim")
