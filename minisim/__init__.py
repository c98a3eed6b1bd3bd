"""A lightweight intersection simulator that hosts decentralised controllers.

    import minisim
    from scenarios import four_way
    from dim import Dim

    run = minisim.simulate(four_way(density=350), Dim(), seed=1)
    run.trips, run.summary(), run.collisions

The names below are loaded when first used, so `import minisim` is quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from minisim.version import __version__

if TYPE_CHECKING:
    from minisim.arrivals import Arrivals, Demand, read_arrivals, write_arrivals
    from minisim.errors import MinisimError
    from minisim.junction.geometry import Intersection
    from minisim.junction.movements import Movement
    from minisim.results.run import Run
    from minisim.simulation import Simulation, simulate
    from minisim.vehicle import VehicleType

_HOME = {
    "Arrivals": "minisim.arrivals",
    "Demand": "minisim.arrivals",
    "Intersection": "minisim.junction.geometry",
    "MinisimError": "minisim.errors",
    "Movement": "minisim.junction.movements",
    "Run": "minisim.results.run",
    "Simulation": "minisim.simulation",
    "VehicleType": "minisim.vehicle",
    "read_arrivals": "minisim.arrivals",
    "simulate": "minisim.simulation",
    "write_arrivals": "minisim.arrivals",
}

__all__ = [
    "Arrivals",
    "Demand",
    "Intersection",
    "MinisimError",
    "Movement",
    "Run",
    "Simulation",
    "VehicleType",
    "__version__",
    "read_arrivals",
    "simulate",
    "write_arrivals",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'minisim' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
