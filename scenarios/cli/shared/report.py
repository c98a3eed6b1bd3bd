"""Results as tables for a terminal."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich import box
from rich.table import Table
from rich.text import Text

from scenarios.statistics import FILLING

if TYPE_CHECKING:
    import pandas as pd

    from figures.studies.shared.section import Item
    from scenarios.sweep.experiment import Experiment

#: Metric of a summary -> heading.
HEADINGS = {
    "waiting_time_s": "waiting [s]",
    "travel_time_s": "travel [s]",
    "depart_delay_s": "departure delay [s]",
}


def run_title(summary: Mapping[str, Any]) -> Text:
    """What was run."""
    return Text.assemble(
        (f"{summary['scenario']}, {summary['controller']}", "bold"),
        f": {summary['density']:g} veh/h/lane, profile {summary['profile']}, "
        f"seed {summary['seed']}, {summary['horizon_s']:g} s",
        "" if summary["host"] == "minisim" else f", host {summary['host']}",
    )


def run_table(summary: Mapping[str, Any]) -> Table:
    """Per-lane and total means of one run."""
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("lane")
    for heading in ("served", "unfinished", *HEADINGS.values()):
        table.add_column(heading, justify="right")
    lanes = list(summary["lanes"].items())
    for k, (lane, means) in enumerate(lanes, start=1):
        table.add_row(lane, *_counts(means), *_means(means), end_section=k == len(lanes))
    table.add_row("all", *_counts(summary), *_means(summary), style="bold")
    table.add_row("with unfinished", "", "", *_means(summary["complete"]), style="dim")
    for name, means in summary.get("drivers", {}).items():
        table.add_row(name, *_counts(means), *_means(means))
    return table


def safety_line(summary: Mapping[str, Any]) -> Text:
    """Collisions and, where measured, the closest calls of one run."""
    safety = summary["safety"]
    collisions = summary["collisions"]
    line = Text.assemble(
        "  collisions ", (str(collisions), "bold red" if collisions else "bold green")
    )
    if safety is None:
        return line
    return line + Text.assemble(
        "   minimum TTC ",
        (_seconds(safety["min_ttc_s"], " s"), "bold"),
        "   minimum PET ",
        (_seconds(safety["min_pet_s"], " s"), "bold"),
    )


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
    for heading in ("name", "what", "studies"):
        table.add_column(heading)
    for item in items:
        table.add_row(item.name, item.title, ", ".join(item.needs) or "none")
    return table


#: Column of `scenarios.studies.cells.cells` -> heading.
CELL_HEADINGS = {
    "waiting_time_s": "waiting [s]",
    "complete_waiting_time_s": "with unfinished",
    "travel_time_s": "travel [s]",
    "complete_depart_delay_s": "departure delay [s]",
}


def sweep_table(cells: pd.DataFrame) -> Table:
    """One line a cell: means over seeds with 95 % confidence intervals."""
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("scenario", "profile", "split", "veh/h/lane", "controller"):
        table.add_column(heading, no_wrap=True)
    for heading in ("runs", *CELL_HEADINGS.values(), "unfinished", "collisions", ""):
        table.add_column(heading, justify="right", no_wrap=True)
    for cell in cells.to_dict("records"):
        named = (cell["scenario"], cell["profile"], cell["split"], f"{cell['density']:g}")
        failed = f" (+{cell['failed']} failed)" if cell["failed"] else ""
        if cell["runs"]:
            collisions = int(cell["collisions"])
            table.add_row(
                *named,
                cell["controller"],
                f"{cell['runs']}{failed}",
                *(_interval(cell, metric) for metric in CELL_HEADINGS),
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


def sweep_notes(rows: pd.DataFrame, cells: pd.DataFrame, experiments: Sequence[Experiment]) -> Text:
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


def _capped(experiments: Sequence[Experiment]) -> list[str]:
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


def _means(means: Mapping[str, Any]) -> list[str]:
    return [_seconds(means[key]) for key in HEADINGS]


def _seconds(value: float | None, unit: str = "") -> str:
    return "–" if value is None else f"{value:.2f}{unit}"
