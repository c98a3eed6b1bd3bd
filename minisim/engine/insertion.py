"""How vehicles come onto the roads."""

from __future__ import annotations

import math

from minisim.engine.cruise.ends import blocked
from minisim.engine.cruise.law import Cruise
from minisim.engine.packed import B_MAX, LENGTH, S, V, admit
from minisim.engine.state import DRIVING, Floats, Ints, Layout, Records
from minisim.jit import njit_inner
from minisim.laws import STOP_MARGIN, Law, insertable, room_behind


@njit_inner
def insert(
    floats: Floats, ints: Ints, vehicles: Records, lanes: Records, layout: Layout, law: Law,
    cruise: Cruise | None, tick: int,
) -> bool:  # fmt: skip
    """Insert the next vehicle that is due on each lane, if the gap allows it; none is dropped.

    Its speed is the highest up to `law.depart_speed` from which it can follow the vehicle ahead,
    brake comfortably for the lower limits ahead, stop before the junction and, while the lane is
    closed, stop comfortably at the hold line.

    Returns whether a vehicle was inserted past a wake-up mark.
    """
    passed = False
    for lane in range(len(lanes)):
        i = lanes[lane]["next"]
        if i == lanes[lane]["end"] or vehicles[i]["demand_tick"] > tick:
            continue
        if cruise is not None and blocked(vehicles, layout, law, cruise, lane):
            continue
        mine, p = layout.types[vehicles[i]["type"]], vehicles[i]["path"]
        s = layout.ends[p, 3] + mine.length + law.margin
        section = 0
        while s >= layout.section_start[p, section + 1]:
            section += 1
        factor = vehicles[i]["factor"]
        v = layout.section_speed[p, section] * factor
        for k in range(section + 1, layout.section_start.shape[1] - 1):
            room = max(layout.section_start[p, k] - s, 0.0)
            v = min(v, math.sqrt((layout.section_speed[p, k] * factor) ** 2 + 2.0 * mine.b * room))
        # It must be able to stop before the junction, where other vehicles may be.
        v = min(v, law.depart_speed, math.sqrt(2.0 * mine.b_max * max(law.entry - s, 0.0)))
        if lanes[lane]["open"] == 0:
            v = min(v, math.sqrt(2.0 * mine.b * max(law.hold - STOP_MARGIN - s, 0.0)))
        if i > lanes[lane]["first"] and vehicles[i - 1]["status"] == DRIVING:
            j = lanes[lane]["slot"] + lanes[lane]["driving"] - 1
            gap = floats[S, j] - floats[LENGTH, j] - s
            safe = insertable(gap, floats[V, j], mine, law)
            if safe < 0.0:
                continue
            room = room_behind(gap, floats[V, j], floats[B_MAX, j], mine, law)
            v = min(v, safe, math.sqrt(max(room, 0.0)))
        lanes[lane]["next"] = i + 1
        vehicles[i]["status"] = DRIVING
        vehicles[i]["s"] = s
        vehicles[i]["v"] = v
        vehicles[i]["depart_tick"] = tick
        vehicles[i]["section"] = section
        while s >= layout.marks[vehicles[i]["mark"]]:
            vehicles[i]["mark"] += 1
            passed = True
        admit(floats, ints, vehicles, lanes, layout, law, i)
    return passed
