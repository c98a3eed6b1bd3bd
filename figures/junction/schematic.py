"""Pictures without results: the junctions, a decision, and the worst case of tied cliques."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle

from dim import Dim, Explanation, HarmonyMatrix, explain
from figures import style
from figures.junction import drawing
from figures.junction.decision import decision_figure
from figures.junction.tables import harmony_table, webster_table
from figures.studies.shared.section import Drawing, Item, Section
from scenarios.library import MAKERS, four_way
from scenarios.scenario import Scenario

#: Number of arms -> a case whose decision is worth a picture; the paper's own on four arms.
DECISIONS = {3: ("a1", "b1", "c1"), 4: ("a1", "b2", "c2", "d2"), 5: ("a1", "b2", "c2", "d2", "e2")}
#: Metres shown around each junction of the map.
MAP_REACH = 48.0

#: Tied cliques, told apart by colour, width and dashes.
CLIQUES = (
    (style.BLUE, "-"), (style.VERMILLION, "--"), (style.GREEN, "-."), (style.PURPLE, ":"),
)  # fmt: skip


def decision(arms: int) -> Figure:
    """Junction and harmony graph of a decision (paper, figure "solution" on four arms)."""
    site = MAKERS[arms]().site()
    matrix = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)
    return decision_figure(explain(DECISIONS[arms], matrix), site, Dim().start(site).plan)


def maps() -> Figure:
    """The paper's three junctions from above, with lanes, zones and the ways of one lane."""
    figure = style.new_figure(11.0, 4.55)
    for k, (arms, make) in enumerate(MAKERS.items()):
        axes = figure.add_axes((0.008 + 0.331 * k, 0.115, 0.322, 0.78))
        _draw_map(axes, make())
        words = "Y junction" if arms == 3 else "junction"
        figure.text(
            0.012 + 0.331 * k, 0.945, f"{arms}-way {words}", fontsize=12, fontweight="bold",
            color=style.INK, va="center",
        )  # fmt: skip
    x = 0.012
    zones = MAKERS[4]().site()
    rules = Dim().zones
    text = {"red": rules.red, "yellow": rules.yellow, "green": rules.green}
    for name, length in text.items():
        figure.add_artist(Rectangle((x, 0.04), 0.018, 0.035, facecolor=style.ZONES[name]))
        figure.text(
            x + 0.024, 0.057, f"{name} zone, {length:g} m", fontsize=9, color=style.INK,
            va="center",
        )  # fmt: skip
        x += 0.13
    figure.text(
        x + 0.01, 0.057,
        f"blue: the ways out of lane a.  Lanes {zones.intersection.lane_width:g} m wide; roads "
        "500 m long; bar 20 m.", fontsize=9, color=style.INK, va="center",
    )  # fmt: skip
    return figure


def _draw_map(axes: Axes, scenario: Scenario) -> None:
    intersection = scenario.intersection
    site = scenario.site()
    plan = Dim().start(site).plan
    axes.add_patch(Rectangle(
        (-MAP_REACH, -MAP_REACH), 2 * MAP_REACH, 2 * MAP_REACH, facecolor=style.GRASS
    ))  # fmt: skip
    drawing.draw_junction(axes, intersection, plan, MAP_REACH)
    for name in axes.texts:
        name.set_fontsize(10)
    for path in intersection.paths:
        if path.movement.origin == 0:
            drawing.draw_way(
                axes, path, path.entry - plan.hold_distance, path.exit + 6.0, style.BLUE,
                strong=False,
            )  # fmt: skip
    left, top = -0.94 * MAP_REACH, 0.94 * MAP_REACH  # where no junction of the paper has a road
    axes.plot([left, left + 20.0], [top, top], color=style.INK, linewidth=2.2, zorder=9,
              solid_capstyle="butt")  # fmt: skip


def worst_case() -> Figure:
    """Four participants with the most tied cliques, and with one harmony more.

    The paper's figure "worst case" draws an abstract graph; these are two real cases of its
    four-way junction.
    """
    site = four_way().site()
    matrix = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)
    figure = style.new_figure(9.2, 4.9)
    cases = (("a1", "b2", "c1", "d2"), _one_more(matrix))
    for k, (letter, case) in enumerate(zip("AB", cases, strict=True)):
        left = 0.02 + 0.49 * k
        told = explain(case, matrix)
        _draw_cliques(figure.add_axes((left, 0.2, 0.47, 0.66)), told)
        figure.text(left, 0.945, letter, fontsize=15, fontweight="bold", color=style.INK,
                    va="center")  # fmt: skip
        figure.text(
            left + 0.03, 0.945,
            f"{len(told.edges)} of 6 pairs in harmony: {len(told.tied)} largest cliques",
            fontsize=12, color=style.INK, va="center",
        )  # fmt: skip
        x = left
        for clique, (colour, _) in zip(told.tied, CLIQUES, strict=False):
            figure.text(x, 0.135, " ".join(map(str, clique)), fontsize=12, fontweight="bold",
                        color=colour, va="center")  # fmt: skip
            x += 0.035 + 0.032 * len(clique)
        figure.text(
            left, 0.06,
            f"{' '.join(map(str, told.right_of_way))} holds the highest-priority lanes and goes.",
            fontsize=10.5, color=style.INK, va="center",
        )  # fmt: skip
    return figure


def _one_more(matrix: HarmonyMatrix) -> tuple[str, ...]:
    """The first case on four arms with five pairs in harmony, as in the paper's second graph."""
    movements = matrix.movements
    lanes = [[m for m in movements if m.origin == lane] for lane in range(4)]
    for case in np.ndindex(3, 3, 3, 3):
        chosen = tuple(str(lanes[lane][k]) for lane, k in enumerate(case))
        if len(explain(chosen, matrix).edges) == 5:
            return chosen
    return DECISIONS[4]


def _draw_cliques(axes: Axes, told: Explanation) -> None:
    """The harmony graph; pairs among the tied cliques as lines, larger ones as areas."""
    axes.set(xlim=(-1.55, 1.55), ylim=(-1.3, 1.3), aspect="equal")
    axes.set_axis_off()
    corners = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)]
    places = {m: np.array(corners[m.origin]) for m in told.participants}
    for one, other in told.edges:
        axes.plot(*np.array([places[one], places[other]]).T, color=style.FAINT, linewidth=11,
                  solid_capstyle="round", zorder=1)  # fmt: skip
    for clique, (colour, dashes) in zip(told.tied, CLIQUES, strict=False):
        points = np.array([places[m] for m in clique])
        if len(clique) > 2:
            points = np.array(
                shapely.Polygon(points).buffer(-0.075, join_style="mitre").exterior.xy
            ).T
            axes.add_patch(Polygon(points, facecolor=colour, alpha=0.12, zorder=1.5))
        axes.plot(*points.T, color=colour, linestyle=dashes, linewidth=3.0, zorder=2)
    for movement, (x, y) in places.items():
        axes.add_patch(Circle((x, y), 0.2, facecolor=style.PAPER, edgecolor=style.INK,
                              linewidth=1.8, zorder=5))  # fmt: skip
        axes.text(x, y, str(movement), ha="center", va="center", fontsize=13, color=style.INK,
                  fontweight="bold", zorder=6)  # fmt: skip


def _item(name: str, title: str, draw: Callable[[], Drawing], *, in_report: bool = True) -> Item:
    return Item(name, title, lambda _: draw(), in_report=in_report)


SECTION = Section(
    "Junctions and rules",
    (
        _item("maps", "the three junctions from above", maps),
        *(
            _item(
                f"decision-{arms}way", f"junction with zones and harmony graph, {arms} arms",
                partial(decision, arms), in_report=arms == 4,
            )
            for arms in DECISIONS
        ),
        _item("worst-case", "the most tied cliques on four arms", worst_case),
        _item("webster", "greens of the fixed-time signal", webster_table),
        *(
            _item(
                f"harmony-{arms}way", f"harmony matrix, {arms} arms",
                partial(harmony_table, arms), in_report=arms == 4,
            )
            for arms in DECISIONS
        ),
    ),
)  # fmt: skip
