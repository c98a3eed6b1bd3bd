"""A run as text for a console and as HTML for a notebook."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any

from minisim.results.metrics import MEANS, METRICS

if TYPE_CHECKING:
    from minisim.results.run import Run

#: Longer names are cut, so that a line stays a line.
LONGEST = 60


def as_text(run: Run) -> str:
    """What was run, its trips and its means, in three lines."""
    summary = run.summary()
    means = ", ".join(
        f"{METRICS[name].title} {_number(summary[name])} {METRICS[name].unit}" for name in MEANS
    )
    return f"Run of {_what(summary)}\n  {_trips(summary)}\n  means: {means}"


def as_html(run: Run) -> str:
    """What was run, and a table of means by lane.

    It sets no colours, so that it is readable in light and dark notebooks.
    """
    summary = run.summary()
    head = "".join(
        f"<th>{escape(words)}</th>"
        for words in ("lane", "trips", "unfinished", *(METRICS[name].heading for name in MEANS))
    )
    lanes = "".join(_html_row(lane, means) for lane, means in summary["lanes"].items())
    return (
        f"<div><p><strong>{escape(_what(summary))}</strong><br>{escape(_trips(summary))}</p>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{lanes}{_html_row('all', summary)}"
        "</tbody></table></div>"
    )


def _html_row(name: str, means: Mapping[str, Any]) -> str:
    cells = (
        name,
        str(means["trips"]),
        str(means["unfinished"]),
        *(_number(means[metric]) for metric in MEANS),
    )
    return f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"


def _what(summary: Mapping[str, Any]) -> str:
    scenario, controller, profile = map(
        _short, (summary["scenario"], summary["controller"], summary["profile"])
    )
    host = "" if summary["host"] == "minisim" else f", host {summary['host']}"
    return (
        f"{scenario}, {controller}: {summary['density']:g} veh/h/lane, profile {profile}, "
        f"seed {summary['seed']}, {summary['horizon_s']:g} s{host}"
    )


def _trips(summary: Mapping[str, Any]) -> str:
    return (
        f"{summary['trips']} trips, {summary['unfinished']} unfinished, "
        f"{summary['collisions']} collisions"
    )


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _short(name: str) -> str:
    line = " ".join(name.split())
    return line if len(line) <= LONGEST else f"{line[:LONGEST]}…"
