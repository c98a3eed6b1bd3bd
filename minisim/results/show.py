"""A run as text for a console and as HTML for a notebook."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any

from minisim.errors import plural
from minisim.results.metrics import MEANS, METRICS

if TYPE_CHECKING:
    from minisim.results.run import Run

#: Names are cut to this length so that each fits on its line.
LONGEST = 60


def as_text(run: Run) -> str:
    """What was run, its trips and its means, in three lines; a fourth if queues spilled back."""
    summary = run.summary()
    shown = [(METRICS[name], _number(summary[name])) for name in MEANS]
    means = ", ".join(f"{metric.title} {value} {metric.unit}" for metric, value in shown)
    lines = (f"Run of {_what(summary)}", _trips(summary), f"means: {means}", spilled(summary))
    return "\n  ".join(filter(None, lines))


def as_html(run: Run) -> str:
    """What was run, and a table of means by lane; no colours, to suit light and dark notebooks."""
    summary = run.summary()
    headings = ("lane", "trips", "unfinished", *(METRICS[name].heading for name in MEANS))
    head = "".join(f"<th>{escape(heading)}</th>" for heading in headings)
    lanes = "".join(_html_row(lane, means) for lane, means in summary["lanes"].items())
    return (
        f"<div><p><strong>{escape(_what(summary))}</strong><br>{escape(_trips(summary))}"
        f"{'<br>' if spilled(summary) else ''}{escape(spilled(summary))}</p>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{lanes}{_html_row('all', summary)}"
        "</tbody></table></div>"
    )


def _html_row(name: str, means: Mapping[str, Any]) -> str:
    counts = str(means["trips"]), str(means["unfinished"])
    cells = (name, *counts, *(_number(means[metric]) for metric in MEANS))
    return f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"


def _what(summary: Mapping[str, Any]) -> str:
    short = {name: _short(summary[name]) for name in ("scenario", "controller", "profile", "fleet")}
    return "{scenario}, {controller}: ".format_map(short) + conditions({**summary, **short})


def conditions(summary: Mapping[str, Any], asked: str = "") -> str:
    """Under which conditions a controller ran; `asked` is the inflow in another unit."""
    warmup = f" (warm-up {summary['warmup_s']:g} s)" if summary["warmup_s"] else ""
    host = "" if summary["host"] == "minisim" else f", host {summary['host']}"
    return (
        f"{summary['density']:g} veh/h/lane{f' ({asked})' * bool(asked)}, "
        f"profile {summary['profile']}, fleet {summary['fleet']}, "
        f"seed {summary['seed']}, {summary['horizon_s']:g} s{warmup}{host}"
    )


def spilled(summary: Mapping[str, Any]) -> str:
    """Which queues reached the end of their road, and when; empty if none did."""
    since = {lane: means["spillback_s"] for lane, means in summary["lanes"].items()}
    told = [f"of lane {lane} at {time:g} s" for lane, time in since.items() if time is not None]
    return f"the queue reached the end of the road {', '.join(told)}" if told else ""


def _trips(summary: Mapping[str, Any]) -> str:
    trips, collisions = plural(summary["trips"], "trip"), plural(summary["collisions"], "collision")
    return f"{trips}, {summary['unfinished']} unfinished, {collisions}"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _short(name: str) -> str:
    line = " ".join(name.split())
    return line if len(line) <= LONGEST else f"{line[:LONGEST]}…"
