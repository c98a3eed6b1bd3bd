"""In which order vehicles pass so that they arrive earliest in sum: exact dynamic programming.

Each lane keeps its order, so a state is how many of each lane have passed, and how early each kind
of vehicle may come next. States grow by one vehicle at a time. Of two states with the same numbers,
one that is later in nothing and has cost no more makes the other superfluous (Yan, Dridi, El
Moudni 2009, IFAC 42(15):252, have this for two lanes). Times before the next vehicle of a kind can
be there say nothing, so states become equal where a junction falls empty, and there are few of
them.

Where there are too many states, those with the same numbers become one that is as good as each of
them (a relaxed decision diagram: Bergman, Cire, van Hoeve, Hooker 2016, Decision Diagrams for
Optimization, ch. 4). What comes out is still below the sum of every order, but no longer that of
one.

If one vehicle can have passed before another could come, it goes first, unless those behind it on
its exit lane lose more than it gains: otherwise it could be moved there, to the good of all.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.prediction import Floats
from minisim.errors import InputError
from minisim.jit import allocating, njit_inline
from minisim.junction.movements import Bools, Ints

#: Times that differ by less are equal [s].
ROUNDING = 1e-9

#: Of schedules with the same sum of arrivals, the one with the least sum of times is best; the sum
#: of times counts so much less.
TIE = 1e-6

#: The most states at once; hours below saturation have some tens. There may be more different
#: numbers, but not without end.
MOST, LARGEST = 2_000, 10_000

#: Spacing of the tables of `Rules.wake` [s].
WAKE_STEP = 0.05


class Rules(NamedTuple):
    """What vehicles must keep, by kind; k kinds."""

    between: Floats  #: least time from the mark of the first to that of the second, (k, k) [s]
    #: Whether the second kind drives behind the first on its exit lane, if it comes after, (k, k).
    joins: Bools
    past: Floats  #: least time from the mark to where vehicles on the exit lane are compared [s]
    rest: Floats  #: least time from the mark to arrival [s]
    #: What a vehicle loses on its exit lane at least, by its time behind the vehicle ahead: falls
    #: from `wake[:, 0]` at 0 by at most 1 s per second, to 0, shape (k, times) [s].
    wake: Floats


class Queue(NamedTuple):
    """The vehicles of a run, lane by lane, in their order; shape (k,) each."""

    ready: Floats  #: when each could pass its mark at the earliest [s]
    kind: Ints  #: of each
    begins: Ints  #: index of each lane's first, and their number at the end, shape (lanes + 1,)


class Schedule(NamedTuple):
    """The best order, and what follows from it."""

    order: Ints  #: indices of vehicles, the first to pass first, shape (k,)
    time: Floats  #: when each passes its mark, by vehicle [s], shape (k,)
    arrival: Floats  #: when each arrives, by vehicle [s], shape (k,)
    bound: float  #: no order has a smaller sum of arrivals [s]
    widest: int  #: the most states at once


def timed(queue: Queue, rules: Rules, order: Ints) -> tuple[Floats, Floats]:
    """When each vehicle passes its mark in this order and arrives, at the earliest [s]."""
    time, arrival = np.zeros((2, len(order)))
    free, ahead = np.full((2, len(rules.rest)), -math.inf)
    for i in order.tolist():
        kind = queue.kind[i]
        time[i] = max(queue.ready[i], free[kind])
        arrival[i] = _arrives(rules, kind, time[i], ahead[kind])
        free = np.maximum(free, time[i] + rules.between[kind])
        out = time[i] + rules.past[kind]
        ahead = np.where(rules.joins[kind], np.maximum(ahead, out), ahead)
    return time, arrival


def scheduled(queue: Queue, rules: Rules, bounded: bool = True) -> Schedule:
    """The order in which vehicles arrive earliest in sum.

    With more than `MOST` states at once, the order may not be the best: states are merged, and
    `bound` still holds; `InputError` for more than `LARGEST` different numbers. If the bound need
    not hold, only the cheapest states go on, which gives better orders.
    """
    k, starts = len(queue.kind), queue.begins[:-1]
    due, lanes = _due(queue, len(rules.rest)), np.arange(len(starts))
    at, cost = starts[None].copy(), np.zeros(1)
    free = due[starts + lanes].max(axis=0, initial=-math.inf)[None]
    ahead = np.full(free.shape, -math.inf)
    steps: list[tuple[Ints, Ints]] = []
    widest = 1
    for _ in range(k):
        at, free, ahead, cost, parent, lane = _next(queue, rules, due, at, free, ahead, cost)
        kept = _undominated(rules, at, free, ahead, cost)
        if len(kept) > MOST:
            if bounded:
                kept, free, ahead = _merged(at, free, ahead, kept)
                if len(kept) > LARGEST:
                    raise InputError(
                        f"the least delay of these {k} vehicles would take too long: more than "
                        f"{LARGEST} states at once; less demand or a shorter horizon helps"
                    )
            else:
                kept = kept[np.argsort(cost[kept], kind="stable")[:MOST]]
        at, free, ahead, cost = at[kept], free[kept], ahead[kept], cost[kept]
        steps.append((parent[kept], lane[kept]))
        widest = max(widest, len(kept))
    order, row, passed = np.empty(k, np.int64), int(cost.argmin()), queue.begins[1:].copy()
    for i in range(k - 1, -1, -1):
        parents, lane = steps[i]
        passed[lane[row]] -= 1
        order[i], row = passed[lane[row]], int(parents[row])
    time, arrival = timed(queue, rules, order)
    # No order costs less, and none is as late at its marks as at its arrivals: of each, ties are at
    # most this part.
    alone = float((queue.ready + rules.rest[queue.kind]).sum())
    return Schedule(order, time, arrival, alone + float(cost.min()) / (1.0 + TIE), widest)


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


@njit_inline
def _arrives(rules: Rules, kind: int, time: float, ahead: float) -> float:
    """When a vehicle arrives that passes its mark at `time`, behind one out at `ahead` [s]."""
    lost = _lost(rules, kind, time + rules.past[kind] - ahead)
    return float(time + rules.rest[kind] + lost)


@njit_inline
def _lost(rules: Rules, kind: int, behind: float) -> float:
    """What a vehicle loses on its exit lane so long behind another [s]."""
    place = max(behind, 0.0) / WAKE_STEP
    if place >= rules.wake.shape[1] - 1:
        return 0.0
    k = int(place)
    left = rules.wake[kind, k] + (place - k) * (rules.wake[kind, k + 1] - rules.wake[kind, k])
    return float(left - min(behind, 0.0))


@allocating
def _next(
    queue: Queue, rules: Rules, due: Floats, at: Ints, free: Floats, ahead: Floats, cost: Floats
) -> tuple[Ints, Floats, Floats, Floats, Ints, Ints]:
    """All states with one vehicle more: their arrays, from which, and by which lane they come."""
    count, lanes = at.shape
    kinds = len(rules.rest)
    ats = np.empty((count * lanes, lanes), np.int64)
    frees, aheads = np.empty((count * lanes, kinds)), np.empty((count * lanes, kinds))
    costs = np.empty(count * lanes)
    parents, chosen = np.empty(count * lanes, np.int64), np.empty(count * lanes, np.int64)
    early = np.empty(lanes)
    memory = (rules.wake.shape[1] - 1) * WAKE_STEP
    new = 0
    for row in range(count):
        for lane in range(lanes):
            i = at[row, lane]
            come = i < queue.begins[lane + 1]
            early[lane] = free[row, queue.kind[i]] if come else np.inf
        for lane in range(lanes):
            state = at[row], free[row], ahead[row]
            if early[lane] == np.inf or _after(queue, rules, due, state, early, lane):
                continue
            i = at[row, lane]
            kind, time = queue.kind[i], early[lane]
            arrival = _arrives(rules, kind, time, ahead[row, kind])
            late = arrival - rules.rest[kind] - queue.ready[i]
            costs[new] = cost[row] + late + TIE * (time - queue.ready[i])
            for other in range(lanes):
                ats[new, other] = at[row, other]
            ats[new, lane] = i + 1
            for other in range(kinds):
                frees[new, other] = aheads[new, other] = -np.inf
                to_come = free[row, other] > -np.inf
                if due[i + lane, other] > -np.inf:  # of this lane
                    to_come = due[i + 1 + lane, other] > -np.inf
                if to_come:
                    least = max(free[row, other], due[i + 1 + lane, other])
                    frees[new, other] = max(least, time + rules.between[kind, other])
                    out = ahead[row, other]
                    if rules.joins[kind, other]:
                        out = max(out, time + rules.past[kind])
                    # What is further ahead no longer matters.
                    first = frees[new, other] + rules.past[other] - memory
                    aheads[new, other] = max(out, first)
            parents[new], chosen[new] = row, lane
            new += 1
    return ats[:new], frees[:new], aheads[:new], costs[:new], parents[:new], chosen[:new]


@njit_inline
def _after(
    queue: Queue, rules: Rules, due: Floats, state: tuple[Ints, Floats, Floats], early: Floats,
    lane: int,
) -> bool:  # fmt: skip
    """Whether the next vehicle of another lane should go before this one.

    Both in the other order, that one could be moved before this one: it delays none, and gains more
    than it loses on its exit lane and costs the vehicles that are now behind it there.
    """
    at, free, ahead = state
    for other in range(len(early)):
        time, gain = early[other], early[lane] - early[other]
        if other == lane or not gain > 0.0:
            continue
        i = at[other]
        kind = queue.kind[i]
        out = time + rules.past[kind]
        gain -= _lost(rules, kind, out - ahead[kind])
        for k in range(len(rules.rest)):
            if free[k] > -np.inf and due[i + other, k] == -np.inf:
                if time + rules.between[kind, k] > early[lane]:
                    gain = 0.0
                if rules.joins[kind, k]:
                    gain -= _lost(rules, k, early[lane] + rules.past[k] - out)
        if gain > ROUNDING:
            return True
    return False


def _undominated(rules: Rules, at: Ints, free: Floats, ahead: Floats, cost: Floats) -> Ints:
    """The states that no other one with the same numbers makes superfluous, by index."""
    low = at.min(axis=0)
    spans = at.max(axis=0) - low + 1
    key = np.ravel_multi_index(tuple((at - low).T), tuple(spans))
    order: npt.NDArray[np.int64] = np.lexsort((cost, key))
    return order[_best(rules, key[order], free[order], ahead[order], cost[order])]


def _merged(at: Ints, free: Floats, ahead: Floats, kept: Ints) -> tuple[Ints, Floats, Floats]:
    """Keep the cheapest states of each set of numbers; the last of them stands for the others.

    It may come as early as each of them and costs no more than any: `kept` is sorted by set, then
    by cost. Returns the indices of the states that stay, and `free` and `ahead` of all.
    """
    new = np.append(True, (at[kept[1:]] != at[kept[:-1]]).any(axis=1))
    begins = np.flatnonzero(new)
    room = max(MOST // len(begins), 1)
    place = np.arange(len(kept)) - begins[np.cumsum(new) - 1]
    stays = np.flatnonzero(place < room)
    merged = []
    for times in (free, ahead):
        times[kept[stays]] = np.minimum.reduceat(times[kept], stays, axis=0)
        merged.append(times)
    return kept[stays], merged[0], merged[1]


@allocating
def _best(rules: Rules, key: Ints, free: Floats, ahead: Floats, cost: Floats) -> Ints:
    """The same for states sorted by their key, then by cost."""
    kept = np.empty(len(key), np.int64)
    count = begin = 0
    for row in range(len(key)):
        if row > 0 and key[row] != key[row - 1]:
            begin = count
        superfluous = False
        for k in range(begin, count):
            if _better(rules, free, ahead, cost, kept[k], row):
                superfluous = True
                break
        if not superfluous:
            kept[count] = row
            count += 1
    return kept[:count]


@njit_inline
def _better(rules: Rules, free: Floats, ahead: Floats, cost: Floats, one: int, other: int) -> bool:
    """Whether no way on from a state ends better than the same way on from another one.

    A vehicle further ahead on an exit lane costs only the next one of each kind, and most if that
    one comes as early as it can.
    """
    kinds = free.shape[1]
    for kind in range(kinds):
        if free[one, kind] > free[other, kind] + ROUNDING:
            return False
    spare = cost[other] - cost[one] + ROUNDING
    for kind in range(kinds):
        if ahead[one, kind] > ahead[other, kind]:
            out = free[one, kind] + rules.past[kind]
            spare -= _lost(rules, kind, out - ahead[one, kind])
            spare += _lost(rules, kind, out - ahead[other, kind])
            if spare < 0.0:
                return False
    return bool(spare >= 0.0)
