"""The paper's two-part figure of a decision: the junction (A) and its harmony graph (B)."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from dim import Explanation
from figures import plots, style
from figures.junction import drawing
from minisim.control import Plan, Site
from minisim.errors import plural
from minisim.junction.geometry import Intersection
from minisim.junction.paths import Floats
from minisim.vehicle import VehicleType

#: Metres of approach lane shown before the junction.
APPROACH = 17.0


def decision_figure(
    explanation: Explanation, site: Site, plan: Plan, body: VehicleType | None = None
) -> Figure:
    """Draw which vehicles may cross, and why; the plan gives the markings and hold line.

    With a `body`, all vehicles are of its type, and their corridors are shown.
    """
    figure = style.new_figure(10.0, 6.0)
    left = figure.add_axes((0.02, 0.13, 0.462, 0.77))
    right = figure.add_axes((0.518, 0.13, 0.462, 0.77))
    _draw_scene(left, explanation, site, plan, body)
    _draw_graph(right, explanation, site.intersection)
    for x, letter, title in (
        (0.02, "A", "Movements, and where they conflict (×)"),
        (0.518, "B", "Harmony graph"),
    ):
        style.write(figure, x, 0.945, letter, 15, bold=True)
        style.write(figure, x + 0.028, 0.945, title, 12)
    if body is not None:
        size = f"{body.length:g} × {body.width:g} m"
        style.write(figure, 0.02, 0.113, f"Shaded: what the bodies sweep ({body.name}, {size}).", 9)
    words = f"Right of way: {', '.join(map(str, explanation.right_of_way))}"
    style.write(figure, 0.02, 0.08, words, 12.5, bold=True, colour=style.RIGHT_OF_WAY)
    style.write(figure, 0.02, 0.035, explanation.reason, 10)
    zones = drawing.zone_words(plan)
    swatches = [Patch(facecolor=style.ZONES.get(name, style.SKY)) for name in zones]
    plots.legend(
        figure, swatches, [*zones.values()], 0.08, loc="center right",
        bbox_to_anchor=(0.98, 0.08), fontsize=9, handlelength=1.4, columnspacing=1.4,
    )  # fmt: skip
    return figure


def _draw_scene(
    axes: Axes, explanation: Explanation, site: Site, plan: Plan, body: VehicleType | None
) -> None:
    intersection, vehicle = site.intersection, body or site.vehicle
    reach = intersection.junction_radius + APPROACH
    drawing.draw_junction(axes, intersection, plan, reach)
    drawing.draw_hold_lines(axes, intersection, plan)
    for movement in explanation.participants:
        path = intersection.path(movement)
        goes = movement in explanation.right_of_way
        colour = style.RIGHT_OF_WAY if goes else style.WAITING
        front = path.entry - plan.hold_distance
        end = path.exit + (3.0 if goes else 5.5)  # keep arrowheads in one exit lane apart
        if body is not None:
            drawing.draw_corridor(axes, path, body, colour)
        drawing.draw_way(axes, path, front, end, colour, bold=goes)
        drawing.draw_vehicle(axes, path, front - 0.15, vehicle, colour)
        middle = plan.hold_distance + vehicle.length / 2.0
        x, y = _beside(intersection, movement.origin, middle, 0.075 * reach)
        axes.text(x, y, str(movement), ha="center", va="center", fontsize=13, fontweight="bold",
                  color=colour, zorder=9)  # fmt: skip
    marks = conflict_points(explanation, intersection)
    axes.plot(*marks.T, "x", color=style.INK, markersize=6.5, markeredgewidth=1.8, zorder=8)


def conflict_points(explanation: Explanation, intersection: Intersection) -> Floats:
    """Where the paths of participants in conflict meet, or come closest, shape (k, 2) [m]."""
    ways = {
        movement: shapely.LineString(path.position(np.linspace(path.entry, path.exit, 100)))
        for movement in explanation.participants
        for path in [intersection.path(movement)]
    }
    pairs = sorted({*combinations(explanation.participants, 2)} - {*explanation.edges})
    closest = [shapely.shortest_line(ways[a], ways[b]).centroid.coords[0] for a, b in pairs]
    return np.array(closest).reshape(-1, 2)


def _draw_graph(axes: Axes, explanation: Explanation, intersection: Intersection) -> None:
    places = {m: np.array(intersection.arms[m.origin].outward) for m in explanation.participants}
    chosen = set(explanation.right_of_way)
    axes.set(xlim=(-1.5, 1.5), ylim=(-1.5, 1.5), aspect="equal")
    axes.set_axis_off()
    for pair in explanation.edges:
        strong = chosen.issuperset(pair)
        colour, width, order = (style.RIGHT_OF_WAY, 7.0, 2) if strong else ("#A7AEB8", 2.2, 1)
        ends = np.array([places[movement] for movement in pair])
        axes.plot(*ends.T, color=colour, linewidth=width, solid_capstyle="round", zorder=order)
    for movement in explanation.participants:
        drawing.draw_node(axes, places[movement], str(movement), goes=movement in chosen)
    pairs = math.comb(len(explanation.participants), 2)
    tied = len(explanation.tied)
    cliques = plural(tied, "clique")
    axes.text(
        0.0, -1.46, f"{len(explanation.edges)} of {pairs} pairs in harmony (lines); "
        f"{cliques} of the largest size, {len(explanation.tied[0])}",
        ha="center", va="bottom", fontsize=9.5, color=style.MUTED,
    )  # fmt: skip


def _beside(intersection: Intersection, arm: int, before: float, room: float) -> Floats:
    """A point `room` metres off an approach lane, `before` metres before the junction."""
    middle, kerb, *_ = drawing.lane_strip(intersection, arm, before, before)
    across = (kerb - middle) / intersection.lane_widths[arm]
    return np.asarray(kerb + across * room)
