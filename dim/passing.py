"""Where a vehicle inside the junction has left another's way for good: what gate "passed" asks."""

from __future__ import annotations

import math

import numpy as np

from dim.harmony import HarmonyMatrix
from minisim.control import Observed, Site
from minisim.junction.conflicts import clearing_distances
from minisim.junction.coordination import STEP

#: How much further a vehicle must be [m]: the regions of a monitor are two steps of their grid
#: wider than the bodies, and what has passed must have passed for a monitor too.
MARGIN = 2 * STEP


class Passing:
    """For each movement, from where on a vehicle on it is out of the way of each foe.

    A foe is a movement of another arm that the matrix has in conflict. The body must keep the
    clearance from the foe's whole corridor, that of the worst type of the fleet. Where geometry
    knows no such place, it is in the way until its rear leaves the junction.
    """

    def __init__(self, matrix: HarmonyMatrix, site: Site) -> None:
        self._rows = site.intersection.movements.rows
        m, copies = len(site.intersection.movements), range(matrix.types)
        foes = ~matrix.values & matrix.movements.apart
        #: By type and row of the movement: (how far past the entry [m], the foe as a bit).
        self._leaves: list[list[list[tuple[float, int]]]] = []
        for kind, vehicle in enumerate(site.types):
            leaves = clearing_distances(site.intersection, vehicle, site.fleet) + MARGIN
            leaves[np.isneginf(leaves)] = math.inf
            first = kind * m if matrix.types > 1 else 0
            self._leaves.append([
                [
                    (float(leaves[foe, way]), 1 << foe + copy * m)
                    for copy in copies for foe in range(m) if foes[foe + copy * m, first + way]
                ]
                for way in range(m)
            ])  # fmt: skip

    def bars(self, vehicle: Observed) -> int:
        """The movements, as bits, in whose way a vehicle inside still is."""
        way = self._rows[vehicle.lane][vehicle.manoeuvre]
        inside = -vehicle.distance
        return sum(bit for leaves, bit in self._leaves[vehicle.type][way] if inside < leaves)
