"""The part of a scene that does not move: the junction, its ways, and how bodies stand on them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from figures import style
from figures.junction import drawing
from figures.player import vlq
from minisim.control import Plan, Site
from minisim.junction.paths import ARC_SEGMENTS, Path
from minisim.junction.turns import indicator
from minisim.vehicle import VehicleType

#: Behind the exit, a body's heading is told for this many of its lengths; then it is straight.
TAIL = 3.0


def picture_reach(site: Site, plan: Plan) -> float:
    """How far from the centre a picture goes [m]: all markings and a little more."""
    zone = max((marking.start for marking in plan.markings), default=0.0)
    return max(40.0, site.intersection.junction_radius + zone + 4.0)


def ground(site: Site, plan: Plan) -> dict[str, Any]:
    """The junction: outlines, lines and zones [m]; each shape is a list x, y, x, y, …"""
    intersection = site.intersection
    reach, every = picture_reach(site, plan), intersection.approaches
    far, radius = 1.5 * reach, intersection.junction_radius
    words = drawing.zone_words(plan)
    middles = [
        np.outer([radius, far], arm.outward)
        for arm, offset in zip(intersection.arms, intersection.offsets, strict=True)
        if offset
    ]
    return {
        "reach": round(reach, 2),
        "entry": round(intersection.paths[0].entry, 3),
        "hold": plan.hold_distance,
        "sight": plan.sight,
        "outline": _flat(drawing.outline(intersection, far)),
        "middles": [_flat(line) for line in middles],
        "entries": [_flat(drawing.lane_strip(intersection, i, 0.15, -0.15)) for i in every],
        "holds": [
            _flat(line) if i in every else None
            for i, line in enumerate(drawing.hold_lines(intersection, plan))
        ],
        "zones": [
            {
                "name": marking.name,
                "words": words[marking.name] + drawing.MEANINGS.get(marking.name, ""),
                "strips": [
                    _flat(drawing.lane_strip(intersection, i, marking.start, marking.end))
                    for i in every
                ],
            }
            for marking in plan.markings
        ],
        "arms": [
            {"name": arm.name, "at": _flat([place])}
            for arm, place in zip(
                intersection.arms, drawing.name_places(intersection, reach), strict=True
            )
        ],
    }


def ways(site: Site) -> list[dict[str, Any]]:
    """The path of each movement from entry to exit, and which other ways it conflicts with."""
    return [
        {
            "name": str(path.movement),
            "lane": path.movement.origin,
            "turn": indicator(path),
            "exit": round(path.exit, 3),
            "to": site.intersection.arms[path.exit_arm].bearing,
            "in": _flat([path.heading_in], 5),
            "out": _flat([path.heading_out], 5),
            "points": _flat(path.points),
            "conflicts": np.flatnonzero(against).tolist(),
        }
        for path, against in zip(site.intersection.paths, site.conflicts, strict=True)
    ]


def headings(path: Path, vehicle: VehicleType) -> str:
    """How a body stands, from the entry on by points of the path [° / 100, clockwise from north].

    See `minisim.junction.paths.Bundle.pose`; second differences as in `figures.player.vlq`.
    """
    step = path.crossing / ARC_SEGMENTS
    count = ARC_SEGMENTS + 1 + math.ceil(TAIL * vehicle.length / step)
    _, heading = path.pose(path.entry + step * np.arange(count), vehicle)
    angle = np.unwrap(np.arctan2(*heading.T))
    hundredths = np.round(100.0 * np.degrees(angle)).astype(np.int64)
    start = np.zeros(1, np.int64)
    return vlq.encoded(vlq.second_differences(hundredths, start), start)[0]


def look() -> dict[str, str]:
    """The colours of the page, by the names of its style sheet."""
    return {
        "ink": style.INK, "muted": style.MUTED, "faint": style.FAINT, "paper": style.PAPER,
        "grass": style.GRASS, "asphalt": style.ASPHALT, "goes": style.RIGHT_OF_WAY,
        "stands": style.WAITING, "moves": style.FREE, "other-zone": style.SKY,
        **{f"zone-{name}": colour for name, colour in style.ZONES.items()},
        **{f"head-{state}": head.colour for state, head in style.HEADS.items()},
    }  # fmt: skip


def _flat(points: Iterable[npt.ArrayLike], decimals: int = 2) -> list[float]:
    return np.round(np.asarray(list(points), float), decimals).ravel().tolist()
