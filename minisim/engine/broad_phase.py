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
    n = count(lanes)
    inside = False
    where, away = floats[S], floats[AWAY]
    for i in range(n):
        inside |= law.entry <= where[i] <= away[i]
    if not inside:
        return False
    ends, shape, headings = layout.ends, layout.shape, layout.headings
    found = 0
    for lane in range(len(lanes)):
        first = lanes[lane]["slot"]
        for i in range(first, first + lanes[lane]["driving"]):
            s, p, length = where[i], ints[PATH, i], floats[LENGTH, i]
            if s < law.entry - law.longest:
                break
            if s > away[i]:
                continue
            if found == len(bodies):
                return True
            past, crossing = s - law.entry, ends[p, 0] - law.entry
            x, y = place(shape[p], headings[p], crossing, past)
            kind = ints[TYPE, i]
            axle = layout.types[kind].rear_axle
            if axle > 0.0:
                ux, uy = drag(shape[p], headings[p], crossing, past, layout.trails[kind, p], axle)
            else:
                x_rear, y_rear = place(shape[p], headings[p], crossing, past - length)
                along = math.hypot(x - x_rear, y - y_rear)
                ux, uy = (x - x_rear) / along, (y - y_rear) / along
            bodies[found, 0] = x - ux * length / 2.0
            bodies[found, 1] = y - uy * length / 2.0
            bodies[found, 2] = ux
            bodies[found, 3] = uy
            bodies[found, 4] = length / 2.0 + TOUCH_MARGIN
            bodies[found, 5] = layout.types[kind].width / 2.0 + TOUCH_MARGIN
            found += 1
    for i in range(found):
        for j in range(i):
            dx = bodies[i, 0] - bodies[j, 0]
            dy = bodies[i, 1] - bodies[j, 1]
            long, wide = bodies[i, 4] + bodies[j, 4], bodies[i, 5] + bodies[j, 5]
            if dx * dx + dy * dy < long * long + wide * wide and rectangles_meet(
                dx, dy, bodies[i, 2], bodies[i, 3], bodies[j, 2], bodies[j, 3],
                bodies[i, 4], bodies[i, 5], bodies[j, 4], bodies[j, 5],
            ):  # fmt: skip
                return True
    return False


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
