"""Which approaches are green together: each alone, or with the one that it faces."""

from __future__ import annotations

from typing import Any

from baselines.signals.heads import full_order
from minisim.junction.geometry import Intersection
from minisim.parameters import switch

#: Two arms face each other if they are at most this far from a straight line [°]: half of a right
#: angle, from where a way is rather a turn.
FACING = 45.0


def facing(intersection: Intersection) -> dict[int, tuple[int, ...]]:
    """The approaches that are green together with each, itself included, in order.

    Arms nearest to a straight line are paired first. One that faces none is green alone, as all
    are on three arms at 120°.
    """
    lanes, bearings = intersection.approaches, intersection.bearings
    bends = sorted(
        (round(abs((bearings[j] - bearings[i]) % 360.0 - 180.0), 6), i, j)
        for i in lanes
        for j in lanes
        if i < j
    )
    phases: dict[int, tuple[int, ...]] = {lane: (lane,) for lane in lanes}
    for bend, i, j in bends:
        if bend <= FACING and len(phases[i]) == len(phases[j]) == 1:
            phases[i] = phases[j] = (i, j)
    return phases


def phases_of(
    order: tuple[int, ...] | None, intersection: Intersection, together: bool
) -> list[tuple[int, ...]]:
    """The phases of a signal, by the first lane of each in an `order` of all lanes.

    Each is an approach alone or, if `together`, with the one that it faces. Raises `InputError`
    unless `order` lists every lane once.
    """
    lanes = full_order(order, intersection)
    phases = facing(intersection) if together else {lane: (lane,) for lane in lanes}
    return list(dict.fromkeys(phases[lane] for lane in lanes))


def facing_switch() -> Any:
    """The field of a signal that says whether approaches that face each other share a green."""
    return switch(
        f"whether approaches that face each other (within {FACING:g}°) are green together, and far "
        "turns wait for gaps; the others stay alone",
        default=False,
    )
