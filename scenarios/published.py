"""Data of the published runs that travel with the project: junctions and arrivals.

See the README beside each kind of file in `scenarios/data` for where it comes from.
"""

from __future__ import annotations

import csv
from functools import lru_cache
from importlib import resources

from minisim.arrivals import Arrivals, read_arrivals
from minisim.errors import choice
from minisim.geometry import Way

#: Arm counts of the published junctions.
PUBLISHED_ARMS = (3, 4, 5)

#: Controllers whose published arrivals are here.
REPLAYED = ("dim", "v2ic")


@lru_cache
def published_ways(arms: int) -> tuple[Way, ...]:
    """The ways through a published junction, in the order of `Intersection.movements`.

    Raises:
        InputError: another number of arms.
    """
    choice("arms of a published junction", str(arms), [str(n) for n in PUBLISHED_ARMS])
    file = resources.files("scenarios") / "data" / "ways" / f"{arms}way.csv"
    with file.open(encoding="utf-8") as text:
        return tuple(_way(row) for row in csv.DictReader(text))


def _way(row: dict[str, str]) -> Way:
    numbers = [float(number) for number in row["points"].split()]
    points = tuple(zip(numbers[::2], numbers[1::2], strict=True))
    return Way(points, float(row["length_m"]), float(row["wait_m"]))


def published_arrivals(split: str, density: int, arms: int, controller: str = "dim") -> Arrivals:
    """The arrivals of a published run of DIM or, on 4 arms, V2I-C.

    Args:
        split: "balanced", "4:3:2:1" or "4:1:4:1".
        density: mean inflow a lane [veh/h].
        arms: of the junction.
        controller: "dim" or "v2ic".

    Raises:
        InputError: no such run was published.
    """
    folder = resources.files("scenarios") / "data" / "arrivals"
    names = sorted(f.name for f in folder.iterdir() if f.name.endswith(".csv"))
    wanted = f"{split.replace(':', '')}_{density}_{controller}_{arms}way.csv"
    kind = {"dim": "DIM", "v2ic": "V2I-C"}[choice("replayed controller", controller, REPLAYED)]
    choice(f"published {kind} run", wanted, [name for name in names if f"_{controller}_" in name])
    with resources.as_file(folder / wanted) as path:
        return read_arrivals(path, arms)
