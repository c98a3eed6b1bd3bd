"""In which order vehicles pass so that their times add up to the least: exact dynamic programming.

Each lane keeps its order, so a state is how many of each lane have passed, and how early each kind
of vehicle may come next. States grow by one vehicle at a time. Of two states with the same numbers,
one that is later in nothing and has cost no more makes the other superfluous (Yan, Dridi, El
Moudni 2009, IFAC 42(15):252, have this for two lanes). Times before the next vehicle of a kind is
there say nothing, so states become equal where a junction falls empty, and there are few of them.

If one vehicle can have passed before another could come, without any that is still to come being
the later for it, it goes first: otherwise it could be moved there, and would be earlier.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from baselines.prediction import Floats
from minisim.jit import allocating, njit_inline
from minisim.junction.movements import Ints

#: Times that differ by less are equal [s].
ROUNDING = 1e-9


class Queue(NamedTuple):
    """The vehicles of a run, lane by lane, in their order; shape (k,) each."""

    ready: Floats  #: when each could pass its mark at the earliest [s]
    kind: Ints  #: of each
    begins: Ints  #: index of each lane's first, and their number at the end, shape (lanes + 1,)


class Schedule(NamedTuple):
    """An order, and the times that follow from it."""

    order: Ints  #: indices of vehicles, the first to pass first, shape (k,)
    time: Floats  #: when each passes its mark, by vehicle [s], shape (k,)
    late: float  #: sum of the times after `Queue.ready` [s]
    bound: float  #: no order has less [s]
    widest: int  #: the most states at once


def timed(queue: Queue, order: Ints, between: Floats) -> Floats:
    """When each vehicle passes its mark in this order, at the earliest [s], shape (k,)."""
    time, latest = np.zeros(len(order)), np.full(len(between), -math.inf)
    for i in order.tolist():
        kind = queue.kind[i]
        time[i] = max(queue.ready[i], latest[kind])
        latest = np.maximum(latest, time[i] + between[kind])
    return time


def scheduled(queue: Queue, between: Floats, width: int = 20_000) -> Schedule:
    """The order with the least sum of times, by `Separations.between`."""
    lanes, k = len(queue.begins) - 1, len(queue.kind)
    due = _due(queue, len(between))
    at, free, cost = queue.begins[None, :-1].copy(), due[queue.begins[:-1] + np.arange(lanes)].max(axis=0)[None], np.zeros(1)
    steps: list[tuple[Ints, Ints]] = []
    widest = 1
    for _ in range(k):
        at, free, cost, parent, lane = _next(queue, between, due, at, free, cost)
        kept = _undominated(at, free, cost)
        if len(kept) > width:
            raise RuntimeError(len(kept))
        at, free, cost = at[kept], free[kept], cost[kept]
        steps.append((parent[kept], lane[kept]))
        widest = max(widest, len(kept))
    order, row, passed = np.empty(k, np.int64), int(cost.argmin()), queue.begins[1:].copy()
    for i in range(k - 1, -1, -1):
        parents, lane = steps[i]
        passed[lane[row]] -= 1
        order[i], row = passed[lane[row]], int(parents[row])
    time = timed(queue, order, between)
    late = float((time - queue.ready).sum())
    return Schedule(order, time, late, late, widest)


def _due(queue: Queue, kinds: int) -> Floats:
    """When the next vehicle of each kind is ready once so many of a lane have passed [s].

    Shape (k + lanes, kinds), −inf for none to come; each lane has a row more than vehicles.
    """
    lanes = len(queue.begins) - 1
    due = np.full((len(queue.kind) + lanes, kinds), -math.inf)
    for lane in range(lanes):
        for i in range(queue.begins[lane + 1] - 1, queue.begins[lane] - 1, -1):
            due[i + lane] = due[i + lane + 1]
            due[i + lane, queue.kind[i]] = queue.ready[i]
    return due


@allocating
def _next(
    queue: Queue, between: Floats, due: Floats, at: Ints, free: Floats, cost: Floats
) -> tuple[Ints, Floats, Floats, Ints, Ints]:
    """All states with one vehicle more: where each lane is, when kinds may come, cost, origin."""
    count, lanes = at.shape
    kinds = len(between)
    ats = np.empty((count * lanes, lanes), np.int64)
    frees = np.empty((count * lanes, kinds))
    costs = np.empty(count * lanes)
    parents = np.empty(count * lanes, np.int64)
    chosen = np.empty(count * lanes, np.int64)
    early, done = np.empty(lanes), np.empty(lanes)
    new = 0
    for row in range(count):
        for lane in range(lanes):
            i = at[row, lane]
            early[lane] = done[lane] = np.inf
            if i < queue.begins[lane + 1]:
                kind = queue.kind[i]
                early[lane] = free[row, kind]
                last = 0.0
                for other in range(kinds):
                    if free[row, other] > -np.inf and due[i + lane, other] == -np.inf:
                        last = max(last, between[kind, other])
                done[lane] = early[lane] + last
        for lane in range(lanes):
            if early[lane] == np.inf or _after(early, done, lane):
                continue
            i = at[row, lane]
            kind = queue.kind[i]
            time = early[lane]
            for other in range(lanes):
                ats[new, other] = at[row, other]
            ats[new, lane] = i + 1
            for other in range(kinds):
                to_come = free[row, other] > -np.inf
                if due[i + lane, other] > -np.inf:  # of this lane
                    to_come = due[i + 1 + lane, other] > -np.inf
                least = max(free[row, other], due[i + 1 + lane, other])
                later = max(least, time + between[kind, other])
                frees[new, other] = later if to_come else -np.inf
            costs[new] = cost[row] + (time - queue.ready[i])
            parents[new], chosen[new] = row, lane
            new += 1
    return ats[:new], frees[:new], costs[:new], parents[:new], chosen[:new]


@njit_inline
def _after(early: Floats, done: Floats, lane: int) -> bool:
    """Whether the next vehicle of another lane has passed before this one could."""
    for other in range(len(early)):
        if other != lane and (
            done[other] < early[lane] or (done[other] == early[lane] and other < lane)
        ):
            return True
    return False


def _undominated(at: Ints, free: Floats, cost: Floats) -> Ints:
    """The states that no other one with the same numbers makes superfluous, by index."""
    low = at.min(axis=0)
    spans = at.max(axis=0) - low + 1
    key = np.ravel_multi_index(tuple((at - low).T), tuple(spans))
    order = np.lexsort((cost, key))
    return order[_best(key[order], free[order], cost[order])]


@allocating
def _best(key: Ints, free: Floats, cost: Floats) -> Ints:
    """The same for states sorted by their key, then by cost."""
    kept = np.empty(len(key), np.int64)
    count = begin = 0
    for row in range(len(key)):
        if row > 0 and key[row] != key[row - 1]:
            begin = count
        if not _dominated(free, kept, begin, count, row):
            kept[count] = row
            count += 1
    return kept[:count]


@njit_inline
def _dominated(free: Floats, kept: Ints, begin: int, count: int, row: int) -> bool:
    for k in range(begin, count):
        least = True
        for kind in range(free.shape[1]):
            if free[kept[k], kind] > free[row, kind] + ROUNDING:
                least = False
                break
        if least:
            return True
    return False
