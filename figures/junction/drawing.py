"""The junction from above, and the nodes of its harmony graph.

Coordinates are in metres, x east and y north, as in `minisim.junction.geometry`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Circle, FancyArrowPatch, Polygon, Rectangle

from figures import style
from minisim.control import Marking, Plan
from minisim.junction.conflicts import corridor
from minisim.junction.curves import join
from minisim.junction.geometry import Arm, Intersection
from minisim.junction.paths import Floats, Path
from minisim.vehicle import VehicleType

#: Length of an arrowhead [pt].
HEAD = 8.0
#: What zones are for, to follow their names in a legend.
MEANINGS = {"red": ": slow", "yellow": ": decide", "green": ": buffer"}
#: Number of points on the kerb between two arms.
KERB_POINTS = 24


def outline(intersection: Intersection, reach: float) -> Floats:
    """Edge of the asphalt, shape (k, 2) [m]; the arms reach `reach` from the centre."""
    halves, arms = intersection.half_widths, intersection.arms
    points: list[Floats] = []
    for k, (arm, half) in enumerate(zip(arms, halves, strict=True)):
        ahead, clockwise = _axes_of(arm)
        points += [ahead * reach - clockwise * half, ahead * reach + clockwise * half]
        following = (k + 1) % len(arms)
        widths = half, halves[following]
        points += [*_kerb(arm, arms[following], widths, intersection.junction_radius)]
    return np.array(points)


def lane_strip(intersection: Intersection, arm: int, start: float, end: float) -> Floats:
    """Corners (4, 2) [m] of the approach lane from `start` to `end` before the junction entry."""
    ahead, clockwise = _axes_of(intersection.arms[arm])
    width, offset = intersection.lane_widths[arm], intersection.offsets[arm]
    across = clockwise * _keep(intersection) * width
    inner = clockwise * _keep(intersection) * (offset - width / 2.0)
    far = ahead * (intersection.junction_radius + start) + inner
    near = ahead * (intersection.junction_radius + end) + inner
    return np.array([far, far + across, near + across, near])


def draw_junction(axes: Axes, intersection: Intersection, plan: Plan, reach: float) -> None:
    """Draw everything that does not move, `reach` metres around the centre."""
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.set_axis_off()
    far = 1.5 * reach
    axes.add_patch(Rectangle((-far, -far), 2 * far, 2 * far, facecolor=style.GRASS))
    axes.add_patch(Polygon(
        outline(intersection, far), facecolor=style.ASPHALT, edgecolor="#9AA2AD", linewidth=1.0,
        joinstyle="round", zorder=1,
    ))  # fmt: skip
    every = intersection.approaches
    for marking in plan.markings:  # the thin edges close the joints between zones
        strips = [lane_strip(intersection, i, marking.start, marking.end) for i in every]
        colour = style.ZONES.get(marking.name, style.SKY)
        axes.add_collection(PolyCollection(
            strips, facecolors=colour, edgecolors=colour, linewidths=0.4, zorder=2
        ))  # fmt: skip
    for i, arm in enumerate(intersection.arms):
        ahead, _ = _axes_of(arm)
        if intersection.offsets[i]:
            middle = np.outer([intersection.junction_radius, far], ahead)
            axes.plot(*middle.T, color=style.PAINT, linewidth=1.2, dashes=(6, 5), zorder=3)
        else:
            _draw_direction(axes, intersection, i, reach)
        if i in every:
            entry = lane_strip(intersection, i, 0.15, -0.15)
            axes.add_patch(Polygon(entry, facecolor=style.PAINT, linewidth=0, zorder=3))
    for arm, (x, y) in zip(intersection.arms, name_places(intersection, reach), strict=True):
        axes.text(
            x, y, arm.name, ha="center", va="center", fontsize=13, fontweight="bold",
            color=style.PAPER, zorder=9,
            bbox={"boxstyle": "circle,pad=0.28", "facecolor": style.INK, "linewidth": 0},
        )  # fmt: skip


def name_places(intersection: Intersection, reach: float) -> list[Floats]:
    """Where the names of the arms stand, beside their approach lanes, each (2,) [m]."""
    places = []
    for arm, half in zip(intersection.arms, intersection.half_widths, strict=True):
        ahead, clockwise = _axes_of(arm)
        beside = clockwise * _keep(intersection) * (half + 0.055 * reach)
        edge = 0.93 * reach - np.abs(beside)
        along = min(edge[k] / abs(ahead[k]) for k in (0, 1) if abs(ahead[k]) > 1e-9)
        places.append(ahead * along + beside)
    return places


def zone_words(plan: Plan) -> dict[str, str]:
    """Zone -> its name and place for a legend, to tell zones apart without colour."""
    zones: dict[str, list[Marking]] = {}
    for marking in plan.markings:
        zones.setdefault(marking.name, []).append(marking)
    return {
        name: f"{name} {max(m.start for m in parts):g}–{min(m.end for m in parts):g} m"
        for name, parts in zones.items()
    }


def hold_lines(intersection: Intersection, plan: Plan) -> Floats:
    """Where vehicles without the right of way stop: one line per lane, shape (n, 2, 2) [m].

    The line of a lane on which no vehicle comes is NaN, and not drawn.
    """
    at = plan.hold_distance
    lines = np.array([lane_strip(intersection, i, at, at)[:2] for i in range(intersection.n)])
    closed = [i for i in range(intersection.n) if i not in intersection.approaches]
    lines[closed] = np.nan
    return lines


def body_shape(vehicle: VehicleType) -> tuple[Floats, Floats]:
    """Body (8, 2) and windscreen (4, 2) of a vehicle at the origin, heading east [m].

    The origin is the middle of the front bumper, as in `Run.trajectories`.
    """
    length, half = vehicle.length, vehicle.width / 2.0
    nose, tail = 0.45 * half, 0.25 * half
    side = [(0, half - nose), (-nose, half), (-length + tail, half), (-length, half - tail)]
    body = np.array([*side, *((x, -y) for x, y in reversed(side))], dtype=float)
    glass_front, glass_back = -0.26 * length, -0.40 * length
    glass = [
        (glass_front, 0.72 * half), (glass_front, -0.72 * half),
        (glass_back, -0.62 * half), (glass_back, 0.62 * half),
    ]  # fmt: skip
    return body, np.array(glass)


def place(shape: Floats, x: npt.ArrayLike, y: npt.ArrayLike, angle_deg: npt.ArrayLike) -> Floats:
    """A shape (k, 2), or one each, at n poses, (n, k, 2); angles clockwise from north [deg]."""
    angle = np.radians(np.atleast_1d(np.asarray(angle_deg, dtype=float)))
    heading = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    left = np.stack([-heading[:, 1], heading[:, 0]], axis=-1)
    origin = np.stack([np.atleast_1d(x), np.atleast_1d(y)], axis=-1)
    along = shape[..., :1] * heading[:, None, :]
    across = shape[..., 1:] * left[:, None, :]
    return np.asarray(origin[:, None, :] + along + across)


def draw_vehicle(axes: Axes, path: Path, s: float, vehicle: VehicleType, colour: str) -> None:
    """Draw a vehicle with its front bumper at `s` on its path."""
    x, y = path.position(s)
    _, heading = path.pose(s, vehicle)
    angle = math.degrees(math.atan2(heading[0], heading[1]))
    body, glass = (place(shape, x, y, angle)[0] for shape in body_shape(vehicle))
    axes.add_patch(Polygon(body, facecolor=colour, edgecolor=style.PAINT, linewidth=1.0, zorder=6))
    axes.add_patch(Polygon(glass, facecolor=style.PAINT, alpha=0.75, linewidth=0, zorder=7))


def draw_corridor(axes: Axes, path: Path, vehicle: VehicleType, colour: str) -> None:
    """Shade the area that a vehicle's body sweeps on its way through the junction."""
    edge = shapely.get_coordinates(shapely.get_exterior_ring(corridor(path, vehicle)))
    axes.add_patch(Polygon(edge, facecolor=colour, alpha=0.16, linewidth=0, zorder=4.5))
    axes.add_patch(Polygon(edge, fill=False, edgecolor=colour, linewidth=0.9, zorder=4.6))


def draw_way(axes: Axes, path: Path, start: float, end: float, colour: str, *, bold: bool) -> None:
    """Draw a path from `start` to `end` as an arrow; a weak one is dashed, and above others."""
    width = axes.bbox.width * 72.0 / axes.figure.dpi / np.ptp(axes.get_xlim())  # points per metre
    neck = end - HEAD / width
    look: dict[str, Any] = {"color": colour, "zorder": 5 if bold else 5.5}
    axes.plot(
        *path.position(np.linspace(start, neck, 48)).T, linewidth=2.6 if bold else 1.5,
        linestyle="-" if bold else (0, (4, 2.5)), dash_capstyle="butt", **look,
    )  # fmt: skip
    axes.add_patch(FancyArrowPatch(
        *path.position(np.array([neck, end])), shrinkA=0, shrinkB=0, linewidth=0,
        arrowstyle=f"-|>,head_length={HEAD},head_width={0.55 * HEAD}", **look,
    ))  # fmt: skip


def draw_hold_lines(axes: Axes, intersection: Intersection, plan: Plan) -> LineCollection:
    """Draw the hold lines; recolour the returned collection to show which lanes are open."""
    segments = list(hold_lines(intersection, plan))
    lines = LineCollection(segments, colors=style.INK, linewidths=3.0, zorder=4, capstyle="butt")
    axes.add_collection(lines)
    return lines


def draw_node(axes: Axes, place: Floats, label: str, *, goes: bool) -> None:
    """Draw a node of a harmony graph; it is filled if its vehicle `goes`."""
    colour = style.RIGHT_OF_WAY if goes else style.WAITING
    face, ink = (colour, style.PAPER) if goes else (style.PAPER, colour)
    x, y = place
    axes.add_patch(Circle((x, y), 0.2, facecolor=face, edgecolor=colour, linewidth=2.2, zorder=3))
    axes.text(x, y, label, ha="center", va="center", fontsize=13, zorder=4, color=ink)


def _axes_of(arm: Arm) -> tuple[Floats, Floats]:
    """Unit vectors outward along an arm and across it, clockwise."""
    ahead = np.array(arm.outward)
    return ahead, np.array([ahead[1], -ahead[0]])


def _keep(intersection: Intersection) -> float:
    """+1 if the approach lane is clockwise of the middle of its arm (left-hand traffic), or −1."""
    return 1.0 if intersection.side == "left" else -1.0


def _draw_direction(axes: Axes, intersection: Intersection, arm: int, reach: float) -> None:
    """Draw an arrow on a one-way road."""
    ahead, _ = _axes_of(intersection.arms[arm])
    ends = np.outer(np.array([0.86, 0.72]) * reach, ahead)
    if arm not in intersection.approaches:
        ends = ends[::-1]
    axes.add_patch(FancyArrowPatch(
        *ends, arrowstyle="-|>", mutation_scale=12, color=style.PAINT, linewidth=1.4, zorder=3
    ))  # fmt: skip


def _kerb(arm: Arm, following: Arm, widths: tuple[float, float], radius: float) -> Floats:
    """The kerb from one arm to the next clockwise, shape (k, 2): an arc tangent to both.

    It meets both road edges at distance `radius` from the centre. If the edges cross farther out,
    it shrinks to the point where they cross. `widths` are half of each road's; between roads of
    different widths it is the curve of `minisim.junction.curves`.
    """
    ahead, clockwise = _axes_of(arm)
    next_ahead, next_clockwise = _axes_of(following)
    half = math.radians((following.bearing - arm.bearing) % 360.0) / 2.0
    width, next_width = widths
    start = ahead * radius + clockwise * width
    end = next_ahead * radius - next_clockwise * next_width
    if width != next_width:
        return np.asarray(join(start, -ahead, end, next_ahead, KERB_POINTS).points)
    if abs(half - math.pi / 2.0) < 1e-3:
        return np.array([start, end])
    signed = radius * math.tan(half) - width
    if half < math.pi / 2.0 and signed <= 0.0:
        return np.array([ahead * (width / math.tan(half)) + clockwise * width])
    centre = start + clockwise * signed
    a, b = start - centre, end - centre
    turn = math.pi - 2.0 * half
    t = np.linspace(0.0, 1.0, KERB_POINTS)[:, None]
    weights = np.sin((1.0 - t) * turn), np.sin(t * turn)
    return np.asarray(centre + (weights[0] * a + weights[1] * b) / math.sin(turn))
