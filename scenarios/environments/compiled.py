"""`minisim/RightOfWay-v0` for many junctions at once, in compiled code.

What `passing.Passing` and `right_of_way.RightOfWayEnv` say in Python, over the arrays of
`minisim.engine.packed`, one world after the other; tests hold both against each other.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from minisim.control import COMMIT_MARGIN, HALTING
from minisim.engine.kernel import advance
from minisim.engine.packed import CLEARED, PATH, ROW, TYPE, S, V
from minisim.engine.state import Floats, Ints, Layout, Records
from minisim.jit import njit, njit_inner
from minisim.laws import Law

Bytes = npt.NDArray[np.int8]
Singles = npt.NDArray[np.float32]


@njit
def step_all(
    floats: Floats,
    ints: Ints,
    vehicles: Records,
    lanes: Records,
    layout: Layout,
    law: Law,
    trace: Records,
    bodies: Floats,
    observed: Records,
    conflicts: Bytes,
    actions: Bytes,
    acts: Bytes,
    ask: Ints,
    taken: Bytes,
    sight: float,
    ticks: Ints,
    targets: Ints,
    reasons: Ints,
) -> int:
    """Carry out the actions of the worlds that `acts` names, and advance each to its target.

    Args:
        floats … lanes: of all worlds, by their first index; see `minisim.engine.packed`.
        trace, bodies, observed: scratch space, as `kernel.advance` takes it.
        conflicts: which movements may not go together, shape (m, m); none if not masked.
        actions: which movements may go, shape (worlds, m).
        acts: which worlds act, shape (worlds).
        ask, taken: scratch space, shapes (n) and (m).
        sight: how far before the junction a vehicle may get the right of way [m].
        ticks, targets, reasons: where each world is, is to go, and why it has stopped.

    Returns:
        How many worlds have stopped before their target.
    """
    early = 0
    for w in range(len(ticks)):
        if acts[w]:
            look(floats[w], ints[w], vehicles[w], lanes[w], layout, law, sight, ask, taken)
            act(ints[w], vehicles[w], lanes[w], conflicts, actions[w], ask, taken)
        if ticks[w] < targets[w]:
            ticks[w], reasons[w], _, _ = advance(
                floats[w], ints[w], vehicles[w], lanes[w], layout, law, None,
                trace, bodies, observed, 0, ticks[w], targets[w], 0,
            )  # fmt: skip
            early += ticks[w] < targets[w]
    return early


@njit_inner
def look(
    floats: Floats,
    ints: Ints,
    vehicles: Records,
    lanes: Records,
    layout: Layout,
    law: Law,
    sight: float,
    ask: Ints,
    taken: Bytes,
) -> None:
    """As `Passing.look`: the slot of the vehicle that asks on each lane, or -1, and what is taken.

    `taken` is 1 for each movement on which a vehicle is settled.
    """
    taken[:] = 0
    for lane in range(len(lanes)):
        ask[lane] = -1
        first = lanes[lane]["slot"]
        last = first + lanes[lane]["driving"]
        rest = first
        for i in range(first, last):  # up to the last one that can no longer stop
            if ints[CLEARED, i] != 0:
                rest = i + 1
                continue
            distance, speed = law.entry - floats[S, i], floats[V, i]
            if distance >= 0.0 and vehicles[ints[ROW, i]]["go"] == 0:
                break
            b = layout.types[ints[TYPE, i]].b
            stops = speed == 0.0 or speed * speed / (2.0 * b) + COMMIT_MARGIN <= distance
            if distance < 0.0 or not stops:
                rest = i + 1
        for i in range(first, rest):
            if ints[CLEARED, i] == 0:
                taken[ints[PATH, i]] = 1
        if rest < last and law.entry - floats[S, rest] <= sight:
            ask[lane] = rest


@njit_inner
def act(
    ints: Ints,
    vehicles: Records,
    lanes: Records,
    conflicts: Bytes,
    action: Bytes,
    ask: Ints,
    taken: Bytes,
) -> None:
    """As `Passing.commands`; `taken` is used up."""
    n = len(lanes)
    for _ in range(n):
        best = -1
        for lane in range(n):  # the one that has waited longest
            if ask[lane] >= 0 and (
                best < 0
                or vehicles[ints[ROW, ask[lane]]]["demand_tick"]
                < vehicles[ints[ROW, ask[best]]]["demand_tick"]
            ):
                best = lane
        if best < 0:
            break
        p, row = ints[PATH, ask[best]], ints[ROW, ask[best]]
        ask[best] = -1
        vehicles[row]["go"] = action[p] != 0 and free(conflicts, taken, p)
        if vehicles[row]["go"] != 0:
            taken[p] = 1


@njit_inner
def free(conflicts: Bytes, taken: Bytes, p: int) -> bool:
    """Whether a movement conflicts with none that is taken."""
    clear = True
    for q in range(len(taken)):
        clear &= not (taken[q] and conflicts[p, q])
    return clear


@njit
def observe_all(
    floats: Floats,
    ints: Ints,
    vehicles: Records,
    lanes: Records,
    layout: Layout,
    law: Law,
    conflicts: Bytes,
    limits: Floats,
    ask: Ints,
    taken: Bytes,
    scales: Floats,
    ticks: Ints,
    seen: Singles,
    masks: Bytes,
    present: Ints,
) -> None:
    """Fill what each world's agent sees, what it may do, and how many vehicles are present.

    `scales` are the sight [m], the time [s] and the number of vehicles that count as 1.
    """
    sight, long, many = scales[0], scales[1], scales[2]
    n, m = lanes.shape[1], masks.shape[1]
    turns = m // n
    width = 5 + turns
    for w in range(len(ticks)):
        look(floats[w], ints[w], vehicles[w], lanes[w], layout, law, sight, ask, taken)
        seen[w, :] = 0.0
        masks[w, :] = 0
        present[w] = 0
        for lane in range(n):
            at = lane * width
            first = lanes[w, lane]["slot"]
            for i in range(first, first + lanes[w, lane]["driving"]):
                if ints[w, CLEARED, i] == 0:
                    present[w] += 1
                    if floats[w, V, i] <= HALTING and floats[w, S, i] <= law.entry:
                        seen[w, at + width - 1] += 1.0 / many
            row = lanes[w, lane]["next"]
            while row < lanes[w, lane]["end"] and vehicles[w, row]["demand_tick"] <= ticks[w]:
                present[w] += 1
                row += 1
            i = ask[lane]
            if i >= 0:
                me, p = vehicles[w, ints[w, ROW, i]], ints[w, PATH, i]
                seen[w, at] = 1.0
                seen[w, at + 1] = (law.entry - floats[w, S, i]) / sight
                seen[w, at + 2] = floats[w, V, i] / limits[lane]
                seen[w, at + 3] = (ticks[w] - me["demand_tick"]) * law.dt / long
                seen[w, at + 3 + me["manoeuvre"]] = 1.0
                masks[w, p] = free(conflicts, taken, p)
        for p in range(m):
            seen[w, n * width + p] = taken[p]
        for k in range(seen.shape[1]):
            seen[w, k] = min(seen[w, k], np.float32(1.0))
