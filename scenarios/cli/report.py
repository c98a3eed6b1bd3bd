"""Results as tables for a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from rich import box
from rich.table import Table
from rich.text import Text

from minisim.geometry import ARM_NAMES

if TYPE_CHECKING:
    from dim import Explanation, HarmonyMatrix
    from figures.gallery import Item

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


def harmony_table(matrix: HarmonyMatrix) -> Table:
    """The matrix with one column a lane: ● harmony, · conflict."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("")
    manoeuvres = range(1, matrix.n)
    for lane in ARM_NAMES[: matrix.n]:
        table.add_column(" ".join(f"{lane}{j}" for j in manoeuvres), no_wrap=True)
    for movement, values in zip(matrix.movements, matrix.values, strict=True):
        cells = [Text(str(movement), style="bold")]
        for first in range(0, len(values), matrix.n - 1):
            part = values[first:].tolist()
            cells.append(Text("").join(map(_mark, part, manoeuvres)))
        table.add_row(*cells, end_section=movement.manoeuvre == matrix.n - 1)
    return table


def decision_text(explanation: Explanation) -> Text:
    """The graph, its cliques, who goes and why."""
    text = Text()
    edges = "  ".join(f"{a}–{b}" for a, b in explanation.edges) or "none"
    text.append("vehicles         ", "dim").append(_names(explanation.participants) + "\n")
    text.append("in harmony       ", "dim").append(edges + "\n")
    tied = len(explanation.tied) > 1
    for k, clique in enumerate(explanation.cliques):
        text.append("maximal cliques  " if k == 0 else " " * 17, "dim")
        text.append(f"{{{_names(clique)}}}", "bold" if k == 0 else "")
        if tied and clique in explanation.tied:
            text.append("  tied", "yellow")
        if k == 0:
            text.append("  ← right of way", "green")
        text.append("\n")
    text.append("right of way     ", "dim").append(_names(explanation.right_of_way), "bold green")
    text.append("\nwhy              ", "dim").append(explanation.reason)
    return text


def gallery_table(items: Iterable[Item]) -> Table:
    """Names and titles of figures and tables, and the studies that they need."""
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("name", "what", "studies"):
        table.add_column(heading)
    for item in items:
        table.add_row(item.name, item.title, ", ".join(item.needs) or "none")
    return table


def _counts(means: Mapping[str, Any]) -> tuple[str, str]:
    return str(means["trips"] - means["unfinished"]), str(means["unfinished"])


def _means(means: Mapping[str, Any]) -> list[str]:
    return [_seconds(means[key]) for key in HEADINGS]


def _names(movements: tuple[Any, ...]) -> str:
    return " ".join(map(str, movements))


def _mark(harmony: bool, manoeuvre: int) -> Text:
    width = len(str(manoeuvre)) + 2
    return Text(f"{'●' if harmony else '·':<{width}}", style="green" if harmony else "dim")


def _seconds(value: float | None, unit: str = "") -> str:
    return "–" if value is None else f"{value:.2f}{unit}"
