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


def published_arrivals(split: str, density: int, arms: int) -> Arrivals:
    """The arrivals of a published DIM run.

    Args:
        split: "balanced", "4:3:2:1" or "4:1:4:1".
        density: mean inflow a lane [veh/h].
        arms: of the junction.

    Raises:
        InputError: no such run was published.
    """
    folder = resources.files("scenarios") / "data" / "arrivals"
    names = sorted(f.name for f in folder.iterdir() if f.name.endswith(".csv"))
    wanted = f"{split.replace(':', '')}_{density}_dim_{arms}way.csv"
    choice("published DIM run", wanted, names)
    with resources.as_file(folder / wanted) as path:
        return read_arrivals(path, arms)
