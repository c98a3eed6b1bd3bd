"""How wrong perception ends: collisions, false grants and delay."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from dim.senses.intent import KINDS, RATES
from dim.senses.noise import CLASSIFIER
from figures import lines, style
from figures.tables import Table
from scenarios.statistics import mean_interval
from scenarios.studies.archive import Archive, missing_note
from scenarios.studies.crossing import METRICS, with_total_delay
from scenarios.studies.misreading import CROSSINGS, MANNERS, THRESHOLDS, Rate, rate_of

if TYPE_CHECKING:
    import pandas as pd

#: (shared, persistent) -> look.
LOOKS: Mapping[tuple[bool, bool], style.Look] = MappingProxyType({
    (True, True): style.Look(MANNERS[True, True], style.BLUE, "o", "-"),
    (True, False): style.Look(MANNERS[True, False], style.SKY, "p", "-"),
    (False, True): style.Look(MANNERS[False, True], style.VERMILLION, "s", "--"),
    (False, False): style.Look(MANNERS[False, False], style.ORANGE, "^", "-."),
})  # fmt: skip
#: Kind of error -> words and look.
KIND_LOOKS: Mapping[str, style.Look] = MappingProxyType({
    "missed": style.Look("missed signals", style.BLUE, "o", "-"),
    "symmetric": style.Look("symmetric errors", style.VERMILLION, "s", "--"),
})  # fmt: skip
#: Turns that are not signalled, at the published rates.
SILENT = style.Look("turns without signal, published rates", style.INK, "", ":")

DELAY = METRICS["time loss and departure delay"]
#: What is drawn: title -> column.
EVENTS = {"Collisions": "collisions", "False grants": "false_grants"}


class Point(NamedTuple):
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


Measure = Callable[["pd.DataFrame"], Point | None]


def perception_figure(archive: Archive, series: str = "dim") -> Figure:
    """Collisions, false grants and delay over the probability of an intent error.

    Args:
        archive: of the runs.
        series: whose vehicles misread.

    Raises:
        MissingRunsError: nothing was run.
    """
    (results,) = archive.need("perception")
    rows = with_total_delay(results.good)
    rows = rows[rows["series"] == series]
    figure = style.new_figure(11.5, 7.4)
    panels = figure.subplots(len(KINDS), len(_measures()), squeeze=False)
    figure.subplots_adjust(
        left=0.062, right=0.988, top=0.815, bottom=0.095, wspace=0.22, hspace=0.42
    )
    signalled = rows[~rows["unsignalled"].astype(bool)]
    exact = signalled[signalled["rate"] == 0.0]
    for kind, row in zip(KINDS, panels, strict=True):
        for axes, (title, measure) in zip(row, _measures().items(), strict=True):
            for place, (manner, look) in enumerate(LOOKS.items()):
                found = _of(signalled, kind=kind, shared=manner[0], persistent=manner[1])
                cells = [exact, *(found[found["rate"] == rate] for rate in RATES[1:])]
                # Side by side, so that bars do not cover each other; rates are far from even.
                places = [k + 0.13 * (place - 1.5) for k in range(len(RATES))]
                _draw(axes, places, cells, measure, look)
            if kind == "missed":
                _level(axes, rows[rows["unsignalled"].astype(bool)], measure)
            style.plot_axes(axes, f"{title}, {KIND_LOOKS[kind].label}", "probability of an error",
                            "")  # fmt: skip
            _scale(axes, title)
            axes.set_xticks(range(len(RATES)), [f"{rate:g}" for rate in RATES])
    _labels(panels.tolist())
    who = style.look(series).label
    _title(figure, f"What misread intents do: {who}, four arms, 250 veh/h/lane, profile fair")
    _legend(figure, [*LOOKS.values(), SILENT])
    note = missing_note([results], lambda case: case.series == series)
    lines.footnote(figure, f"{_NOTE}  {note}")
    return figure


def confidence_figure(archive: Archive) -> Figure:
    """The same over the confidence below which an intent is taken for unknown; errors as above."""
    (results,) = archive.need("confidence")
    rows = with_total_delay(results.good)
    figure = style.new_figure(11.5, 4.6)
    panels = figure.subplots(1, len(_measures()), squeeze=False)
    figure.subplots_adjust(left=0.062, right=0.988, top=0.735, bottom=0.155, wspace=0.22)
    for axes, (title, measure) in zip(panels[0], _measures().items(), strict=True):
        for kind, look in KIND_LOOKS.items():
            found = _of(rows, kind=kind)
            cells = [found[found["confidence"] == threshold] for threshold in THRESHOLDS]
            _draw(axes, list(range(len(THRESHOLDS))), cells, measure, look)
        style.plot_axes(axes, title, "least confidence that is believed", "")
        _scale(axes, title)
        ticks = ["any", *(f"{threshold:g}" for threshold in THRESHOLDS[1:])]
        axes.set_xticks(range(len(THRESHOLDS)), ticks)
    _labels(panels.tolist())
    _title(figure, f"Believing only what is sure: lanes first, {CLASSIFIER:.0%} of intents misread "
                   "by all alike, lasting")  # fmt: skip
    _legend(figure, KIND_LOOKS.values())
    lines.footnote(figure, f"{_NOTE}  {missing_note([results], lambda _: True)}")
    return figure


def perception_table(archive: Archive) -> Table:
    """All outcomes at the error rate of published classifiers; errors as above."""
    (results,) = archive.need("perception")
    rows = with_total_delay(results.good)
    chosen = rows[rows["rate"].isin([0.0, CLASSIFIER])]
    keys = ["series", "rate", "unsignalled", "kind", "shared", "persistent"]
    listed = []
    for (series, rate, silent, kind, shared, persistent), cell in chosen.groupby(keys, sort=False):
        what = "exact" if rate == 0.0 else f"{KIND_LOOKS[str(kind)].label}"
        how = "" if rate == 0.0 else MANNERS[bool(shared), bool(persistent)]
        listed.append((
            str(series), "turns without signal" if silent else what, "all alike, lasting"
            if silent else how, *_outcomes(cell),
        ))  # fmt: skip
    return Table(
        f"What misread intents do, {CLASSIFIER:.0%} of them misread, on four arms, 250 veh/h/lane",
        ("controller", "error", "who", "crossings", f"collisions / {CROSSINGS:,} crossings",
         f"false grants / {CROSSINGS:,}", "disagreement [% of time]", "deadlock [% of time]",
         "unfinished [%]", "delay [s]"),
        tuple(listed), labels=3,
        notes=(f"{_NOTE}  {missing_note([results], lambda _: True)}",),
    )  # fmt: skip


_NOTE = (
    "Intervals 95 %: of counts Poisson's (Garwood), of delays Student's over seeds. Delay: time "
    "loss and departure delay."
)


def _measures() -> dict[str, Measure]:
    """Title of a panel -> what it shows."""
    counts: dict[str, Measure] = {
        title: partial(_rate, column=column) for title, column in EVENTS.items()
    }
    return {**counts, "Mean delay": _delay}


def _rate(rows: pd.DataFrame, column: str) -> Point | None:
    found = rate_of(rows, column)
    return Point(found.rate, found.low, found.high) if found else None


def _delay(rows: pd.DataFrame) -> Point:
    mean = mean_interval(rows[DELAY].astype(float).tolist())
    half = mean.half_width if mean.size > 1 else 0.0
    return Point(mean.mean, mean.mean - half, mean.mean + half)


def _of(rows: pd.DataFrame, **wanted: object) -> pd.DataFrame:
    for key, value in wanted.items():
        rows = rows[rows[key] == value]
    return rows


def _draw(
    axes: Axes, places: Sequence[float], cells: Sequence[pd.DataFrame], measure: Measure,
    look: style.Look,
) -> None:  # fmt: skip
    points = [
        (x, point)
        for x, cell in zip(places, cells, strict=True)
        if not cell.empty and (point := measure(cell)) is not None
    ]
    if not points:
        return
    y = [point.value for _, point in points]
    bars = [[p.value - p.low for _, p in points], [p.high - p.value for _, p in points]]
    axes.errorbar(
        [x for x, _ in points], y, yerr=bars, color=look.colour, marker=look.marker,
        linestyle=look.dashes, linewidth=1.7, markersize=5.0, capsize=2.6, elinewidth=1.1, zorder=3,
    )  # fmt: skip


def _level(axes: Axes, rows: pd.DataFrame, measure: Measure) -> None:
    point = None if rows.empty else measure(rows)
    if point is not None:
        axes.axhline(point.value, color=SILENT.colour, linestyle=SILENT.dashes, linewidth=1.4)


def _scale(axes: Axes, title: str) -> None:
    if title in EVENTS:
        lines.log_time(axes, 0.0, 10_000.0, linear=1.0)
    else:
        lines.log_time(axes, 1.0, 4000.0)


def _labels(panels: Iterable[Sequence[Axes]]) -> None:
    for first, *_, last in panels:
        first.set_ylabel(f"in {CROSSINGS:,} crossings", fontsize=9.0, color=style.INK)
        last.set_ylabel("of all vehicles [s]", fontsize=9.0, color=style.INK)


def _title(figure: Figure, text: str) -> None:
    figure.text(0.012, 0.965, text, fontsize=13, fontweight="bold", color=style.INK, va="center")


def _legend(figure: Figure, looks: Iterable[style.Look]) -> None:
    shown = list(looks)
    handles = [
        Line2D([], [], color=k.colour, marker=k.marker, linestyle=k.dashes, linewidth=1.7,
               markersize=5.5)
        for k in shown
    ]  # fmt: skip
    figure.legend(
        handles, [k.label for k in shown], loc="upper left", ncols=3, frameon=False, fontsize=9.5,
        bbox_to_anchor=(0.012, 0.93), labelcolor=style.INK, borderaxespad=0.0, columnspacing=1.7,
        handlelength=2.4,
    )  # fmt: skip


def _outcomes(cell: pd.DataFrame) -> tuple[str, ...]:
    seconds = float(cell["horizon_s"].sum())
    share = {
        column: 100.0 * float(cell[column].fillna(0.0).sum()) / seconds if column in cell else 0.0
        for column in ("disagreement_s", "deadlock_s")
    }
    crossings = rate_of(cell, "collisions")
    unfinished = 100.0 * float(cell["unfinished"].sum()) / float(cell["trips"].sum())
    delay = mean_interval(cell[DELAY].astype(float).tolist())
    return (
        f"{crossings.crossings:,}" if crossings else "0",
        _count(crossings), _count(rate_of(cell, "false_grants")),
        f"{share['disagreement_s']:.1f}", f"{share['deadlock_s']:.1f}", f"{unfinished:.1f}",
        str(delay),
    )  # fmt: skip


def _count(rate: Rate | None) -> str:
    return f"{rate.rate:.0f} ({rate.low:.0f} … {rate.high:.0f})" if rate else "–"
