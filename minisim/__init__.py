"""A lightweight intersection simulator that hosts decentralised controllers.

    import minisim
    from scenarios import four_way
    from dim import Dim

    run = minisim.simulate(four_way(density=350), Dim(), seed=1)
    run.trips, run.summary(), run.collisions

The names below are loaded on first use, so `import minisim` is quick.
"""

from minisim.lazy import TYPE_CHECKING, loader
from minisim.version import __version__

if TYPE_CHECKING:
    from minisim.arrivals import Arrivals
    from minisim.counts import read_counts
    from minisim.demand import Demand, DemandProfile, Period
    from minisim.demandfile import read_demand, write_demand
    from minisim.errors import MinisimError
    from minisim.junction.geometry import Intersection
    from minisim.junction.movements import Movement
    from minisim.junction.roads import Road
    from minisim.recorded import read_arrivals, write_arrivals
    from minisim.results.run import Run
    from minisim.simulation import Simulation, simulate
    from minisim.town import read_junction
    from minisim.vehicle import VehicleType

__getattr__ = loader(__name__, {
    "minisim.arrivals": "Arrivals",
    "minisim.counts": "read_counts",
    "minisim.demand": "Demand DemandProfile Period",
    "minisim.demandfile": "read_demand write_demand",
    "minisim.errors": "MinisimError",
    "minisim.junction.geometry": "Intersection",
    "minisim.junction.movements": "Movement",
    "minisim.junction.roads": "Road",
    "minisim.recorded": "read_arrivals write_arrivals",
    "minisim.results.run": "Run",
    "minisim.simulation": "Simulation simulate",
    "minisim.town": "read_junction",
    "minisim.vehicle": "VehicleType",
})  # fmt: skip

__all__ = [
    "Arrivals",
    "Demand",
    "DemandProfile",
    "Intersection",
    "MinisimError",
    "Movement",
    "Period",
    "Road",
    "Run",
    "Simulation",
    "VehicleType",
    "__version__",
    "read_arrivals",
    "read_counts",
    "read_demand",
    "read_junction",
    "simulate",
    "write_arrivals",
    "write_demand",
]


def __dir__() -> list[str]:
    return sorted(__all__)
