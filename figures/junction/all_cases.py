"""All cases of a junction: how many vehicles go, how often cliques tie, and the worst case."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from dim import Explanation, explain
from dim.proofs.verification import Analysis
from figures import style
from figures.junction import drawing
from minisim.errors import plural
from minisim.junction.geometry import Intersection

#: Colours and dashes of tied cliques, so that they are told apart without colour too.
CLIQUES = (
    (style.BLUE, "-"), (style.VERMILLION, "--"), (style.GREEN, "-."), (style.PURPLE, ":"),
    (style.ORANGE, "-"), (style.SKY, "--"),
)  # fmt: skip


def verification_figure(analysis: Analysis, intersection: Intersection) -> Figure:
    """Draw `dim.proofs.verification.analyse`; the arms determine where the nodes go."""
    worst = list(analysis.worst.items())
    figure = style.new_figure(4.2 * (2 + len(worst)), 4.4)
    panels = figure.subplots(1, 2 + len(worst))
    figure.subplots_adjust(left=0.06, right=0.985, top=0.77, bottom=0.14, wspace=0.26)
    false = [claim.name for claim in analysis.claims if not claim.holds]
    verdict = f"false: {', '.join(false)}" if false else "every claim holds in each of them"
    title = f"{analysis.n} arms, {analysis.cases} cases, order {analysis.order}: {verdict}"
    style.write(figure, 0.06, 0.93, title, 12.5, bold=True)
    _draw_counts(panels[0], analysis.sizes, "Right of way", "vehicles with the right of way")
    _draw_counts(panels[1], analysis.ties, "Ties", "cliques of the largest size")
    for axes, (size, (movements, count)) in zip(panels[2:], worst, strict=True):
        told = explain(movements, analysis.matrix, analysis.order, analysis.priorities)
        draw_cliques(axes, told, intersection)
        vehicles = plural(size, "vehicle")
        axes.set_title(
            f"Worst case: {plural(analysis.most_tied, 'clique')} of {vehicles}\n"
            f"{' '.join(map(str, movements))}{'' if count == 1 else f' (one of {count})'}",
            fontsize=10, color=style.INK, loc="center",
        )  # fmt: skip
    return figure


def _draw_counts(axes: Axes, counts: Mapping[int, int], title: str, xlabel: str) -> None:
    bars = axes.bar(list(counts), list(counts.values()), color=style.BLUE, width=0.7, zorder=3)
    axes.bar_label(bars, fontsize=8.5, color=style.INK, padding=2)
    axes.set_xticks(list(counts))
    axes.margins(y=0.12)
    style.plot_axes(axes, title, xlabel, "cases")


def draw_cliques(axes: Axes, explanation: Explanation, intersection: Intersection) -> None:
    """A harmony graph: tied cliques of two as lines, larger ones as areas; filled nodes go."""
    places = {m: np.array(intersection.arms[m.origin].outward) for m in explanation.participants}
    axes.set(xlim=(-1.4, 1.4), ylim=(-1.4, 1.4), aspect="equal")
    axes.set_axis_off()
    for pair in explanation.edges:
        ends = np.array([places[m] for m in pair])
        axes.plot(*ends.T, color=style.FAINT, linewidth=11, solid_capstyle="round", zorder=1)
    for clique, (colour, dashes) in zip(explanation.tied, cycle(CLIQUES), strict=False):
        points = np.array([places[m] for m in clique])
        if len(clique) > 2:
            inner = shapely.Polygon(points).buffer(-0.075, join_style="mitre")
            points = np.array(inner.exterior.coords)
            axes.add_patch(Polygon(points, facecolor=colour, alpha=0.12, zorder=1.5))
        width = 4.0 if clique == explanation.right_of_way else 2.4
        axes.plot(*points.T, color=colour, linestyle=dashes, linewidth=width, zorder=2)
    for movement, place in places.items():
        goes = movement in explanation.right_of_way
        drawing.draw_node(axes, place, str(movement), goes=goes)
