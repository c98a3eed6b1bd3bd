"""Passenger car units: how many cars a vehicle counts as, by its type."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from minisim.errors import choice
from minisim.fleet import Fleet, kind_of

#: Units of an inflow that are passenger car units, and how many a vehicle of each type counts.
#:
#: `pcu` is IRC:106-1990 (table 1), with a factor for a type that makes up 5 % of the traffic and
#: one for 10 % or more. `pcu-irc64` is IRC:64-1990, with one. `pcu-hcm` is the Highway Capacity
#: Manual (2000, chapter 16), which counts a heavy vehicle at a junction as two cars, and knows
#: neither motorcycles nor auto-rickshaws.
UNITS: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "pcu": {
        "motorcycle": (0.5, 0.75), "auto-rickshaw": (1.2, 2.0), "car": (1.0, 1.0),
        "lcv": (1.4, 2.0), "bus": (2.2, 3.7), "truck": (2.2, 3.7),
    },
    "pcu-irc64": {
        "motorcycle": (0.5, 0.5), "auto-rickshaw": (1.0, 1.0), "car": (1.0, 1.0),
        "lcv": (1.5, 1.5), "bus": (3.0, 3.0), "truck": (3.0, 3.0),
    },
    "pcu-hcm": {"car": (1.0, 1.0), "lcv": (1.0, 1.0), "bus": (2.0, 2.0), "truck": (2.0, 2.0)},
}  # fmt: skip


def pcu_factors(fleet: Fleet, unit: str, n: int) -> tuple[float, ...]:
    """Passenger car units of a vehicle of each type, by its mean share over `n` lanes.

    If a unit has two factors, the first holds up to a share of 5 % and the second from 10 % on; in
    between, the factor is interpolated. Raises `InputError` for an unknown unit, or a type without
    a factor.
    """
    table = UNITS[choice("passenger car unit", unit, UNITS)]
    shares = np.mean([fleet.of_lane(lane) for lane in range(n)], axis=0)
    kinds = map(kind_of, fleet.names)
    rows = [table[choice(f"vehicle type in {unit}", kind, table)] for kind in kinds]
    return tuple(
        float(np.interp(share, (0.05, 0.10), row)) for share, row in zip(shares, rows, strict=True)
    )


def mean_pcu(fleet: Fleet, unit: str, n: int) -> tuple[float, ...]:
    """Passenger car units of the mean vehicle of each of `n` lanes."""
    factors = pcu_factors(fleet, unit, n)
    return tuple(float(np.dot(factors, fleet.of_lane(lane))) for lane in range(n))
