"""The paper's result figures: waiting and travel time over demand, its own values beside ours."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import lines, style
from scenarios import paper
from scenarios.paper import DENSITIES
from scenarios.studies.archive import Archive, missing_note
from scenarios.studies.comparison import published

if TYPE_CHECKING:
    import pandas as pd


#: The paper's controllers, in the order of its text.
SERIES = tuple(paper.SERIES.values())
#: Study -> title of its panel.
PANELS: Mapping[str, str] = MappingProxyType({
    "as-run": "As the published runs were made",
    "text": "As the text prescribes it",
})  # fmt: skip
METRICS: Mapping[str, str] = MappingProxyType(
    {"waiting_time_s": "waiting time", "travel_time_s": "travel time"}
)
#: Metric -> ends of the axis [s] and where it turns linear.
SCALES: Mapping[str, tuple[float, float, float | None]] = MappingProxyType(
    {"waiting_time_s": (0.0, 500.0, 0.1), "travel_time_s": (45.0, 500.0, None)}
)
WORDS = {3: "3 arms", 4: "4 arms", 5: "5 arms"}


def split_figure(archive: Archive, metric: str, split: str) -> Figure:
    """All four controllers on four arms under one split.

    Args:
        archive: of the studies `PANELS`.
        metric: of `METRICS`.
        split: of `scenarios.paper.SPLITS`.

    Raises:
        MissingRunsError: nothing was run.
    """
    results = archive.need(*PANELS)
    figure, panels = _canvas()
    for axes, found in zip(panels, results, strict=True):
        rows = _chosen(found.good, 4, split)
        table = published()
        wanted = _chosen(table[(table["metric"] == metric) & (table["lane"] == "all")], 4, split)
        lines.draw_means(axes, rows, metric, SERIES)
        lines.draw_published(axes, wanted, rows, SERIES)
        _dress(axes, PANELS[found.study.name], metric)
    name = "equal inflow" if split == "balanced" else f"inflow {split}"
    _head(figure, f"Mean {METRICS[metric]}, 4 arms, {name}", metric, SERIES)
    lines.footnote(figure, missing_note(results, lambda c: c.where == f"4 arms, {split}"))
    return figure


def arms_figure(archive: Archive, metric: str) -> Figure:
    """DIM on three, four and five arms with equal inflow; arguments as in `split_figure`."""
    results = archive.need(*PANELS)
    figure, panels = _canvas()
    names = tuple(f"dim-{n}" for n in WORDS)
    for axes, found in zip(panels, results, strict=True):
        rows = _by_arms(found.good[found.good["split"] == "balanced"])
        table = published()
        table = table[(table["metric"] == metric) & (table["lane"] == "all")]
        wanted = _by_arms(table[table["split"] == "balanced"])
        lines.draw_means(axes, rows, metric, names)
        lines.draw_published(axes, wanted, rows, names)
        _dress(axes, PANELS[found.study.name], metric)
    _head(figure, f"Mean {METRICS[metric]} under DIM by number of arms", metric, names)
    lines.footnote(
        figure,
        missing_note(results, lambda c: c.series == "dim" and c.where.endswith(", balanced")),
    )
    return figure


def _chosen(table: pd.DataFrame, arms: int, split: str) -> pd.DataFrame:
    return table[(table["arms"] == arms) & (table["split"] == split)]


def _by_arms(table: pd.DataFrame) -> pd.DataFrame:
    """DIM only, with a series for each number of arms."""
    found = table[table["series"] == "dim"].copy()
    found["series"] = "dim-" + found["arms"].astype(str)
    return found


def _canvas() -> tuple[Figure, list[Axes]]:
    figure = style.new_figure(9.2, 4.9)
    panels = list(figure.subplots(1, 2, sharey=True))
    figure.subplots_adjust(left=0.07, right=0.988, top=0.735, bottom=0.15, wspace=0.07)
    return figure, panels


def _dress(axes: Axes, title: str, metric: str) -> None:
    low, high, linear = SCALES[metric]
    style.plot_axes(axes, title, lines.DENSITY_LABEL, "")
    lines.log_time(axes, low, high, linear=linear)
    axes.set_xticks(DENSITIES)
    axes.set_xlim(DENSITIES[0] - 14, DENSITIES[-1] + 14)


def _head(figure: Figure, title: str, metric: str, series: tuple[str, ...]) -> None:
    label = f"mean {METRICS[metric]} [s], {lines.scale_words(SCALES[metric][2])}"
    figure.axes[0].set_ylabel(label, fontsize=9.5, color=style.INK)
    figure.text(0.012, 0.965, title, fontsize=13, fontweight="bold", color=style.INK, va="center")
    lines.series_legend(figure, series, 0.012, 0.925)
    lines.marks_legend(figure, 0.012, 0.868, paper=True)
