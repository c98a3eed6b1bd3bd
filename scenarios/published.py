"""Junctions and arrivals of the published runs, from `scenarios/data`; see the READMEs there."""

from __future__ import annotations

import csv
from functools import lru_cache
from importlib import resources

import numpy as np

from minisim.arrivals import Arrivals
from minisim.errors import choice
from minisim.junction.movements import ARM_NAMES, movements_of
from minisim.junction.paths import Way
from minisim.recorded import read_arrivals

#: The letters of the arms, clockwise from north, in the authors' networks since 10 August 2023,
#: when the runs at 4:1:4:1 were made (in their `my_network.net.xml`, b+ is south and c+ east).
RENAMED, RENAMED_ARMS = "4:1:4:1", "acbd"

#: Numbers of arms of the published junctions.
PUBLISHED_ARMS = (3, 4, 5)


#: Arms at whose far end the road leads back, in the authors' networks of 4 arms, by split.
TURNAROUNDS = {"balanced": "bc", "4:3:2:1": "bc", RENAMED: "abcd"}


@lru_cache
def published_ways(arms: int, turnarounds: str | None = None, network: str = "") -> tuple[Way, ...]:
    """The ways through a published junction, in the order of `Intersection.movements`.

    Args:
        arms: how many.
        turnarounds: arms at whose far end the road leads back; None: as in the authors' networks.
        network: "signals" for that of the signals, "waiting" for that of the fixed-time signal at
            4:1:4:1. They differ in the places to wait inside for vehicles that turn far: none, and
            one on each such way, where the others of 4 arms have two.

    Raises `InputError` for another number of arms.
    """
    choice("arms of a published junction", str(arms), [str(n) for n in PUBLISHED_ARMS])
    name = "_".join(filter(None, (f"{arms}way", network)))
    file = resources.files("scenarios") / "data" / "ways" / f"{name}.csv"
    if turnarounds is None:
        turnarounds = TURNAROUNDS["balanced"] if arms == 4 else ""
    with file.open(encoding="utf-8") as text:
        rows = list(csv.DictReader(text))
    exits = movements_of(arms).exits.tolist()  # the rows are in their order
    return tuple(
        _way(row, ARM_NAMES[exit_arm] in turnarounds)
        for row, exit_arm in zip(rows, exits, strict=True)
    )


def _way(row: dict[str, str], turns_back: bool) -> Way:
    points = tuple(zip(*[map(float, row["points"].split())] * 2, strict=True))
    return Way(
        points, float(row["length_m"]), float(row["wait_m"]),
        speed=float(row["speed_mps"]), major=row["major"] == "1",
        yields=tuple(row["yields"].split()), foes=tuple(row["foes"].split()),
        turns_back=turns_back,
    )  # fmt: skip


def published_arrivals(split: str, density: int, arms: int, controller: str = "dim") -> Arrivals:
    """The arrivals of a published run (`scenarios.paper.Cell`), mapped to our junctions' arms.

    Raises:
        InputError: no such run was published.
    """
    folder = resources.files("scenarios") / "data" / "arrivals"
    names = sorted(f.name for f in folder.iterdir() if f.name.endswith(".csv"))
    wanted = f"{split.replace(':', '')}_{density}_{controller}_{arms}way.csv"
    choice("published run", wanted, names)
    with resources.as_file(folder / wanted) as path:
        arrivals = read_arrivals(path, arms)
    if split != RENAMED:
        return arrivals
    lane = np.array([ARM_NAMES.index(letter) for letter in RENAMED_ARMS]).argsort()[arrivals.lane]
    return Arrivals(arrivals.time, lane, arrivals.manoeuvre, arrivals.speed_factor)
