"""Whether any two bodies may touch: the quick look before `minisim.engine.collision` decides."""

from __future__ import annotations

import math

from minisim.engine.packed import AWAY, LENGTH, PATH, TYPE, S, count
from minisim.engine.state import Floats, Ints, Layout, Records
from minisim.jit import njit_apart, njit_inline, njit_inner
from minisim.junction.paths import dragged, locate
from minisim.laws import Law

#: Bodies this close may be touching, given rounding [m]; the exact check follows in pymunk.
TOUCH_MARGIN = 0.02

#: `locate` and `dragged`, compiled: where the front of a vehicle is, and its heading.
place, drag = njit_inline(locate), njit_inline(dragged)


@njit_apart
def may_touch(
    floats: Floats, ints: Ints, lanes: Records, layout: Layout, law: Law, bodies: Floats
) -> bool:
    """Broad phase: whether any two bodies in or near the junction may touch.

    The separating-axis test is exact, and the rectangles are a little larger than the bodies, so
    it misses no touch that pymunk would find.
    """
    if not crossed(floats, law, count(lanes)):
        return False
    found = 0
    for lane in range(len(lanes)):
        first = lanes[lane]["slot"]
        for i in range(first, first + lanes[lane]["driving"]):
            if floats[S, i] < law.entry - law.longest:
                break
            if floats[S, i] <= floats[AWAY, i]:
                if found == len(bodies):
                    return True
                embody(floats, ints, layout, law, i, bodies[found])
                found += 1
    for i in range(found):
        for j in range(i):
            if bodies_meet(bodies[i], bodies[j]):
                return True
    return False


@njit_inline
def crossed(floats: Floats, law: Law, n: int) -> bool:
    """Whether any vehicle is in the junction, or not far past it."""
    s, away = floats[S], floats[AWAY]
    inside = False
    for i in range(n):
        inside |= (s[i] >= law.entry) & (s[i] <= away[i])
    return inside


@njit_inline
def embody(floats: Floats, ints: Ints, layout: Layout, law: Law, i: int, body: Floats) -> None:
    """Fill in a vehicle's body: its centre, its heading, and half of its length and width [m]."""
    p, kind, length = ints[PATH, i], ints[TYPE, i], floats[LENGTH, i]
    shape, headings = layout.shape[p], layout.headings[p]
    past, crossing = floats[S, i] - law.entry, layout.ends[p, 0] - law.entry
    x, y = place(shape, headings, crossing, past)
    axle = layout.types[kind].rear_axle
    if past <= 0.0:
        ux, uy = headings[0], headings[1]
    elif axle > 0.0:
        ux, uy = drag(shape, headings, crossing, past, layout.trails[kind, p], axle)
    else:
        x_rear, y_rear = place(shape, headings, crossing, past - length)
        dx, dy = x - x_rear, y - y_rear
        along = math.sqrt(dx * dx + dy * dy)
        ux, uy = dx / along, dy / along
    body[0], body[1] = x - ux * length / 2.0, y - uy * length / 2.0
    body[2], body[3] = ux, uy
    body[4] = length / 2.0 + TOUCH_MARGIN
    body[5] = layout.types[kind].width / 2.0 + TOUCH_MARGIN


@njit_inline
def bodies_meet(one: Floats, other: Floats) -> bool:
    """Whether two bodies, as `embody` fills them in, meet; most are too far apart."""
    dx, dy = one[0] - other[0], one[1] - other[1]
    reach = one[4] + one[5] + other[4] + other[5]  # no corner is farther from its centre
    return dx * dx + dy * dy < reach * reach and rectangles_meet(
        dx, dy, one[2], one[3], other[2], other[3], one[4], one[5], other[4], other[5]
    )


@njit_inner
def rectangles_meet(
    dx: float, dy: float, ux: float, uy: float, wx: float, wy: float,
    u_length: float, u_width: float, w_length: float, w_width: float,
) -> bool:  # fmt: skip
    """Separating-axis test of rectangles with headings u and w, centres (dx, dy) apart.

    Lengths and widths are halved.
    """
    cos = abs(ux * wx + uy * wy)
    sin = abs(ux * wy - uy * wx)
    along = u_length + w_length * cos + w_width * sin
    across = u_width + w_length * sin + w_width * cos
    if abs(dx * ux + dy * uy) > along or abs(dy * ux - dx * uy) > across:
        return False
    along = w_length + u_length * cos + u_width * sin
    across = w_width + u_length * sin + u_width * cos
    return abs(dx * wx + dy * wy) <= along and abs(dy * wx - dx * wy) <= across
