"""Whether any two bodies may touch: the quick look before `minisim.engine.collision` decides."""

from __future__ import annotations

import math

from minisim.engine.state import DRIVING, Floats, Records, Road
from minisim.jit import njit, njit_inline
from minisim.junction.paths import locate
from minisim.laws import Law

#: Bodies this close may be touching, given rounding [m]; the exact check follows in pymunk.
TOUCH_MARGIN = 0.02

#: `locate`, compiled: where the front of a vehicle is.
place = njit_inline(locate)


@njit
def may_touch(vehicles: Records, lanes: Records, road: Road, law: Law, bodies: Floats) -> bool:
    """Broad phase: whether any two bodies in or near the junction may touch.

    The separating-axis test is exact, and the rectangles are a little larger than the bodies, so
    it misses no touch that pymunk would find.
    """
    ends, shape, headings = road.ends, road.shape, road.headings
    count, inside = 0, False
    for lane in range(len(lanes)):
        for i in range(lanes[lane]["first"], lanes[lane]["next"]):
            s = vehicles[i]["s"]
            p = vehicles[i]["path"]
            if s < law.entry - law.length:
                break
            if vehicles[i]["status"] != DRIVING or s > ends[p, 0] + 2.0 * law.length:
                continue
            if count == len(bodies):
                return True
            inside |= s >= law.entry
            past, crossing = s - law.entry, ends[p, 0] - law.entry
            x, y = place(shape[p], headings[p], crossing, past)
            x_rear, y_rear = place(shape[p], headings[p], crossing, past - law.length)
            along = math.hypot(x - x_rear, y - y_rear)
            ux, uy = (x - x_rear) / along, (y - y_rear) / along
            bodies[count, 0] = x - ux * law.length / 2.0
            bodies[count, 1] = y - uy * law.length / 2.0
            bodies[count, 2] = ux
            bodies[count, 3] = uy
            count += 1
    if not inside:
        return False
    half_length = law.length / 2.0 + TOUCH_MARGIN
    half_width = law.width / 2.0 + TOUCH_MARGIN
    reach = 4.0 * (half_length * half_length + half_width * half_width)
    for i in range(count):
        for j in range(i):
            dx = bodies[i, 0] - bodies[j, 0]
            dy = bodies[i, 1] - bodies[j, 1]
            if dx * dx + dy * dy < reach and rectangles_meet(
                dx, dy, bodies[i, 2], bodies[i, 3], bodies[j, 2], bodies[j, 3],
                half_length, half_width,
            ):  # fmt: skip
                return True
    return False


@njit
def rectangles_meet(
    dx: float, dy: float, ux: float, uy: float, wx: float, wy: float,
    half_length: float, half_width: float,
) -> bool:  # fmt: skip
    """Separating-axis test of equal rectangles with headings u and w, centres (dx, dy) apart."""
    cos = abs(ux * wx + uy * wy)
    sin = abs(ux * wy - uy * wx)
    along = half_length + half_length * cos + half_width * sin
    across = half_width + half_length * sin + half_width * cos
    if abs(dx * ux + dy * uy) > along or abs(dy * ux - dx * uy) > across:
        return False
    return abs(dx * wx + dy * wy) <= along and abs(dy * wx - dx * wy) <= across
