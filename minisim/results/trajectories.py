"""Trajectories and trips on disk: column names, and writers that never leave half a file."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from minisim.control import Site
from minisim.errors import InputError, instance
from minisim.files import replacing, write_table
from minisim.junction.movements import ARM_NAMES, Movement
from minisim.junction.paths import Floats
from minisim.results.summary import TRIP_COLUMNS

if TYPE_CHECKING:
    import pandas as pd

#: Columns of `run.trajectories`: a row per vehicle and step, sorted by time, then vehicle.
TIME: Final = "time_s"
VEHICLE: Final = "vehicle"
TYPE: Final = "type"  #: after the vehicle, if there is more than one type
LANE: Final = "lane"
MANOEUVRE: Final = "manoeuvre"
S: Final = "s_m"
X: Final = "x_m"
Y: Final = "y_m"
ANGLE: Final = "angle_deg"
SPEED: Final = "speed_mps"
ACCELERATION: Final = "acceleration_mps2"
RIGHT_OF_WAY: Final = "right_of_way"

TRAJECTORY_COLUMNS: Final = (
    TIME, VEHICLE, LANE, MANOEUVRE, S, X, Y, ANGLE, SPEED, ACCELERATION, RIGHT_OF_WAY,
)  # fmt: skip

_FCD_HEAD: Final = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<fcd-export xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
    'xsi:noNamespaceSchemaLocation="http://sumo.dlr.de/xsd/fcd_file.xsd">\n'
)


def write_trajectories(frame: pd.DataFrame, path: str | os.PathLike[str]) -> None:
    """Write `run.trajectories` as CSV or Parquet, depending on the suffix of `path`.

    Raises `InputError` for a missing column or any other suffix, `MissingExtraError` for
    Parquet without pyarrow, and `FileError` if the file cannot be written; no partial file remains.
    """
    check_columns(frame)
    write_table(frame, path)


def write_trips(frame: pd.DataFrame, path: str | os.PathLike[str]) -> None:
    """Write `run.trips` likewise, with empty cells for what an unfinished trip lacks."""
    check_columns(frame, TRIP_COLUMNS)
    write_table(frame, path)


def write_fcd(frame: pd.DataFrame, path: str | os.PathLike[str], site: Site) -> None:
    """Write `run.trajectories` as SUMO floating-car data (fcd-export), which SUMO's tools read.

    As in SUMO, x and y are the centre of the front bumper [m], the angle is in degrees clockwise
    from north, and `pos` is the front bumper's distance from the start of its lane [m]. Lanes are
    named `a_in_0` (approach), `:C_a1_0` (inside the junction, by movement) and `b_out_0` (exit).

    Raises `InputError` for a missing column or a movement that the site does not have, and
    `FileError` if the file cannot be written; no partial file remains.
    """
    instance("site", site, Site)
    check_columns(frame)
    movement = movement_index(frame, site)
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.write(_FCD_HEAD)
        file.writelines(_fcd_lines(frame, site, movement))
        file.write("</fcd-export>\n")


def movement_index(frame: pd.DataFrame, site: Site) -> npt.NDArray[np.int64]:
    """Each row's movement by index, shape (rows,); raises `InputError` if the site lacks it."""
    n = site.intersection.n
    codes, names = frame[LANE].factorize()
    index = {name: k for k, name in enumerate(ARM_NAMES[:n])}
    unknown = [str(name) for name in names if str(name) not in index]
    if unknown or (codes < 0).any():
        lane = unknown[0] if unknown else "(missing)"
        raise InputError(f"lane {lane} is not in the geometry (a … {ARM_NAMES[n - 1]})")
    turn = frame[MANOEUVRE].to_numpy(dtype=np.int64)
    outside = (turn < 1) | (turn >= n)
    if outside.any():
        raise InputError(f"manoeuvre {turn[outside][0]} does not exist with {n} arms (1 … {n - 1})")
    lanes = np.array([index[str(name)] for name in names], dtype=np.int64)
    return np.asarray(site.intersection.movements.index_of[lanes[codes], turn])


def check_columns(frame: pd.DataFrame, columns: Iterable[str] = TRAJECTORY_COLUMNS) -> None:
    """Raise `InputError` unless `frame` is a DataFrame with all these columns."""
    import pandas as pd

    instance("frame", frame, pd.DataFrame)
    missing = [column for column in columns if column not in frame.columns]
    if missing:
        raise InputError(f"the frame has no column {', '.join(missing)}")


def _fcd_lines(frame: pd.DataFrame, site: Site, movement: npt.NDArray[np.int64]) -> Iterator[str]:
    """The lines of the timesteps; rows are sorted by time."""
    names, positions = _sumo_lanes(frame[S].to_numpy(dtype=float), movement, site)
    # Rounded as for printing, so that 359.999 becomes 0.00 and −0.001 does not become −0.00.
    numbers = [frame[c].to_numpy(dtype=float).round(2) + 0.0 for c in (X, Y, ANGLE, SPEED)]
    numbers[2] %= 360.0
    columns = [column.tolist() for column in (*numbers, positions)]
    now: float | None = None
    for time, vehicle, x, y, angle, speed, pos, lane in zip(
        frame[TIME], frame[VEHICLE], *columns, names, strict=True
    ):
        if time != now:
            closing = "" if now is None else "    </timestep>\n"
            yield f'{closing}    <timestep time="{time:.3f}">\n'
            now = time
        yield (
            f'        <vehicle id="{vehicle}" x="{x:.2f}" y="{y:.2f}" angle="{angle:.2f}" '
            f'type="car" speed="{speed:.2f}" pos="{pos:.2f}" lane="{lane}" slope="0.00"/>\n'
        )
    if now is not None:
        yield "    </timestep>\n"


def _sumo_lanes(s: Floats, movement: npt.NDArray[np.int64], site: Site) -> tuple[list[str], Floats]:
    """Each row's lane, named as in SUMO, and the position on it [m]."""
    paths = site.intersection.paths
    names = np.array([lane_names(p.movement, p.exit_arm) for p in paths])
    starts = np.array([(p.start, p.entry, p.exit) for p in paths])
    section = (s[:, None] >= starts[movement, 1:]).sum(axis=1)
    return names[movement, section].tolist(), s - starts[movement, section]


def lane_names(movement: Movement, exit_arm: int) -> tuple[str, str, str]:
    """Names of a movement's approach lane, its way through the junction and its exit lane."""
    approach, leave = ARM_NAMES[movement.origin], ARM_NAMES[exit_arm]
    return f"{approach}_in_0", f":C_{movement}_0", f"{leave}_out_0"
