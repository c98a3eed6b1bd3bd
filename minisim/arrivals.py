"""Demand and the arrival table drawn from it.

The table is drawn before the run from the run's own streams, so every controller meets the same
vehicles.
"""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from minisim.errors import FileError, InputError, choice, instance, integer, number, numbers, show
from minisim.files import read_file, write_text
from minisim.junction.movements import ARM_NAMES
from minisim.parameters import checked, declared, real, word
from minisim.streams import stream

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

MODELS = ("poisson", "exponential", "shifted")
COLUMNS = ("demand_time_s", "lane", "manoeuvre")
#: Words for equal shares of the lanes and of the manoeuvres.
BALANCED, UNIFORM = "balanced", "uniform"
#: May follow in a table: the drivers' factors on the speed limit.
FACTORS = "speed_factor"
#: Of a driver; SUMO cuts its speedFactor to the same range.
LEAST_FACTOR, MOST_FACTOR = 0.2, 2.0
#: More than any lane can carry: a higher density is a typing error.
MAX_DENSITY = 3600.0
#: The forms in which callers may give shares.
Shares = Sequence[float] | str | None
#: The longest duration and the latest demand time [s].
MAX_TIME = 1e7


@dataclass(frozen=True, eq=False)
class Arrivals:
    """An arrival table, sorted by demand time (ties keep lane order).

    All columns have the shape (k,).
    """

    time: Floats  # demand time [s]
    lane: Ints  # index of the approach lane
    manoeuvre: Ints  # 1 … n−1
    speed_factor: Floats | None = None  # drivers' factors on the speed limit; None: they are drawn

    def __post_init__(self) -> None:
        time = _column("demand_time_s", self.time, np.float64)
        lane = _column("lane", self.lane, np.int64)
        manoeuvre = _column("manoeuvre", self.manoeuvre, np.int64)
        columns = {"time": time, "lane": lane, "manoeuvre": manoeuvre}
        if self.speed_factor is not None:
            factors = _column("speed_factor", self.speed_factor, np.float64)
            if len(factors) and not LEAST_FACTOR <= factors.min() <= factors.max() <= MOST_FACTOR:
                raise InputError(f"a speed_factor must be {LEAST_FACTOR:g} … {MOST_FACTOR:g}")
            columns["speed_factor"] = factors
        if any(len(column) != len(time) for column in columns.values()):
            raise InputError("an arrival table needs as many times as lanes and manoeuvres")
        if len(time) and (not np.isfinite(time).all() or time.min() < 0):
            raise InputError("demand times must be finite and not negative")
        if len(time) and time.max() > MAX_TIME:
            raise InputError(f"demand times must be at most {MAX_TIME:g} s, got {time.max():g}")
        order = np.lexsort((lane, time))
        for name, column in columns.items():
            column = column[order]
            column.setflags(write=False)
            object.__setattr__(self, name, column)

    def __len__(self) -> int:
        return len(self.time)

    def check(self, n: int) -> None:
        """Raise `InputError` for a lane or manoeuvre that does not exist with n arms."""
        for bad in self.lane[(self.lane < 0) | (self.lane >= n)].tolist():
            name = ARM_NAMES[bad] if 0 <= bad < len(ARM_NAMES) else str(bad)
            raise InputError(f"lane {name} is not in the geometry (lanes a … {ARM_NAMES[n - 1]})")
        for bad in self.manoeuvre[(self.manoeuvre < 1) | (self.manoeuvre >= n)].tolist():
            raise InputError(f"manoeuvre {bad} does not exist with {n} arms (1 … {n - 1})")

    def rates(self, n: int, horizon: float) -> tuple[float, ...]:
        """Mean inflow of each lane over the first `horizon` seconds [veh/h]."""
        counts = np.bincount(self.lane[self.time < horizon], minlength=n)
        return tuple(float(c) * 3600.0 / horizon for c in counts)


def read_shares(name: str, value: object, equal: str) -> tuple[float, ...] | None:
    """Shares given as numbers, or as text such as "4:3:2:1" or "(4, 3, 2, 1)"; None if equal.

    Args:
        name: what messages call them.
        value: the shares; None and the word `equal` both mean equal shares.
        equal: that word.

    Raises:
        InputError: not finite numbers, a negative one, or only zeros.
    """
    if value is None:
        return None
    if isinstance(value, str):
        if value == equal:
            return None
        text = value.strip()
        listed = text[1:-1] if text[:1] + text[-1:] in ("()", "[]") else text
        try:
            value = tuple(map(float, re.split("[:,]", listed)))
        except ValueError:
            raise InputError(
                f"{name} is {equal} or written like 4:3:2:1, got {show(value)}"
            ) from None
    shares = numbers(name, value)
    if not shares or min(shares) < 0 or not 0 < sum(shares) < math.inf:
        raise InputError(f"{name} must be shares ≥ 0, not all 0; got {show(value)}")
    return shares


def shares_text(shares: Shares, equal: str) -> str:
    """Shares as `read_shares` returns them, as text such as "4:3:2:1" or the word `equal`."""
    return equal if shares is None else ":".join(f"{float(share):g}" for share in shares)


@declared(kw_only=True)
class Demand:
    """How many vehicles come, from where, and where to.

    Shares may be given as numbers or as text such as "4:3:2:1"; they are kept as a tuple of
    floats, or None if they are equal. All models of arrivals have the same mean headway. The
    paper's is Poisson: it draws a count of arrivals for every second.
    """

    density: float = real(
        "mean inflow a lane; with a split, the mean over all lanes", "veh/h/lane",
        low=0, high=MAX_DENSITY,
    )  # fmt: skip
    split: Shares = checked(
        "shares of the lanes",
        partial(read_shares, equal=BALANCED), f"shares such as 4:3:2:1 | {BALANCED}", default=None,
    )  # fmt: skip
    turns: Shares = checked(
        "shares of the manoeuvres 1 … n−1, the same on every lane",
        partial(read_shares, equal=UNIFORM), f"shares such as 1:2:1 | {UNIFORM}", default=None,
    )  # fmt: skip
    model: str = word(
        "of the arrivals: poisson counts, exponential headways, or headways shifted by min_headway",
        MODELS, default="poisson", label="arrival model",
    )  # fmt: skip
    min_headway: float = real("of the shifted model", "s", default=1.5, low=0, high=60)

    def rates(self, n: int) -> tuple[float, ...]:
        """Mean inflow of each of n lanes [veh/h]."""
        shares = _shares("split", self.split, n, "lanes")
        rates = tuple(self.density * n * share for share in shares)
        if max(rates) > MAX_DENSITY:
            raise InputError(
                f"the split gives a lane {max(rates):g} veh/h; at most {MAX_DENSITY:g} are allowed"
            )
        if self.model == "shifted" and max(rates) / 3600.0 * self.min_headway >= 1.0:
            raise InputError(
                f"{max(rates):g} veh/h leave no room for a min_headway of {self.min_headway:g} s"
            )
        return rates

    def draw(self, n: int, duration: float, seed: int) -> Arrivals:
        """Draw the arrivals on n lanes over `duration` seconds.

        Manoeuvres are drawn independently. (The authors drew them without replacement within a
        second, which ends the run when more vehicles come than there are manoeuvres; at 350
        veh/h/lane that affects 0.4 % of the lane-seconds.)
        """
        number("duration [s]", duration, above=0, high=MAX_TIME)
        turns = _shares("turns", self.turns, n - 1, "manoeuvres")
        rng = stream(seed, "arrivals")
        times = [self._lane_times(rate / 3600.0, duration, rng) for rate in self.rates(n)]
        lane = np.repeat(np.arange(n), [len(t) for t in times])
        time = np.concatenate(times)
        order = np.lexsort((lane, time))
        manoeuvre = stream(seed, "manoeuvres").choice(np.arange(1, n), size=len(time), p=turns)
        return Arrivals(time[order], lane[order], manoeuvre)

    def _lane_times(self, rate: float, duration: float, rng: np.random.Generator) -> Floats:
        """Arrival times on one lane with `rate` veh/s."""
        if rate == 0.0:
            return np.empty(0)
        if self.model == "poisson":
            counts = rng.poisson(rate, size=math.ceil(duration))
            seconds = np.repeat(np.arange(len(counts), dtype=float), counts)
            return seconds[seconds < duration]
        shift = self.min_headway if self.model == "shifted" else 0.0
        times: list[Floats] = []
        last = 0.0
        while last < duration:
            headways = shift + rng.exponential(1.0 / rate - shift, size=256)
            times.append(last + np.cumsum(headways))
            last = float(times[-1][-1])
        drawn = np.concatenate(times)
        return drawn[drawn < duration]


def read_arrivals(path: str | os.PathLike[str], n: int | None = None) -> Arrivals:
    """Read an arrival table from a CSV file with the columns `COLUMNS`, its lanes named by letter.

    A column `speed_factor` may be there too.

    Raises:
        FileError: unreadable, a missing or unknown column, a broken line (named by its number), or
            a lane or manoeuvre that does not exist with n arms.
    """
    if n is not None:
        integer("number of arms", n, low=3, high=len(ARM_NAMES))
    data, rows, factors = read_file("arrivals", path), [], []
    try:
        reader = csv.DictReader(io.StringIO(data.decode("utf-8-sig"), newline=""))
        header = list(reader.fieldnames or ())
        _check_header(path, header)
        for row in reader:
            rows.append(_parse_row(path, reader.line_num, row, n))
            if FACTORS in header:
                factors.append(_parse_factor(path, reader.line_num, row[FACTORS]))
    except (csv.Error, ValueError) as error:
        raise FileError(f"cannot read arrivals from {path}: {error}") from error
    time, lane, manoeuvre = zip(*rows, strict=True) if rows else ((), (), ())
    return Arrivals(
        np.array(time, float), np.array(lane, int), np.array(manoeuvre, int),
        np.array(factors, float) if FACTORS in header else None,
    )  # fmt: skip


def write_arrivals(arrivals: Arrivals, path: str | os.PathLike[str]) -> None:
    """Write an arrival table in the form that `read_arrivals` reads; raises `FileError`."""
    instance("arrivals file", path, (str, os.PathLike))
    instance("arrivals", arrivals, Arrivals)
    arrivals.check(len(ARM_NAMES))
    lanes = [ARM_NAMES[lane] for lane in arrivals.lane]
    columns = dict(zip(COLUMNS, (arrivals.time.tolist(), lanes, arrivals.manoeuvre), strict=True))
    if arrivals.speed_factor is not None:
        columns[FACTORS] = arrivals.speed_factor.tolist()
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    write_text(path, text.getvalue())


def _check_header(path: str | os.PathLike[str], header: Sequence[str]) -> None:
    if len(header) == 1 and (mark := re.search("[;\t|]", header[0])):
        raise FileError(f"{path}: its columns are separated by {mark[0]!r}; commas are needed")
    wrong = [column for column in COLUMNS if header.count(column) != 1]
    if wrong:
        raise FileError(
            f"{path}: column {', '.join(wrong)} missing or twice; "
            f"needed once each: {', '.join(COLUMNS)}"
        )
    for column in header:
        try:
            choice("column", column, (*COLUMNS, FACTORS))
        except InputError as error:
            raise FileError(f"{path}: {error}") from None


def _parse_row(
    path: str | os.PathLike[str], line: int, row: dict[str, str], n: int | None
) -> tuple[float, int, int]:
    where = f"{path}, line {line}"
    texts = [row.get(column) for column in COLUMNS]
    if None in row or None in texts:
        raise FileError(f"{where}: expected {len(COLUMNS)} values, {', '.join(COLUMNS)}")
    time_text, lane_text, manoeuvre_text = (str(t).strip() for t in texts)
    lanes = ARM_NAMES[: n or len(ARM_NAMES)]
    try:
        time = number("demand_time_s", float(time_text), low=0, high=MAX_TIME)
    except ValueError:
        raise FileError(
            f"{where}: demand_time_s must be a number 0 … {MAX_TIME:g}, got {show(time_text)}"
        ) from None
    if len(lane_text) != 1 or lane_text not in lanes:
        raise FileError(f"{where}: lane must be one of {', '.join(lanes)}, got {show(lane_text)}")
    try:
        manoeuvre = integer("manoeuvre", int(manoeuvre_text), low=1, high=len(lanes) - 1)
    except ValueError:
        raise FileError(
            f"{where}: manoeuvre must be 1 … {len(lanes) - 1}, got {show(manoeuvre_text)}"
        ) from None
    return time, lanes.index(lane_text), manoeuvre


def _parse_factor(path: str | os.PathLike[str], line: int, text: str | None) -> float:
    try:
        return number(FACTORS, float(text or ""), low=LEAST_FACTOR, high=MOST_FACTOR)
    except ValueError:
        raise FileError(
            f"{path}, line {line}: {FACTORS} must be a number {LEAST_FACTOR:g} … {MOST_FACTOR:g}, "
            f"got {show(text)}"
        ) from None


def _shares(name: str, given: Shares, count: int, things: str) -> tuple[float, ...]:
    """Shares of `count` things, summing to 1."""
    if given is None:
        return (1.0 / count,) * count
    shares = tuple(map(float, given))  # `Demand` has already turned text into numbers
    if len(shares) != count:
        raise InputError(f"{name} has {len(shares)} shares for {count} {things}")
    total = sum(shares)
    return tuple(share / total for share in shares)


def _column(name: str, value: npt.ArrayLike, dtype: type) -> npt.NDArray[np.generic]:
    wanted = InputError(f"{name} must be a one-dimensional column of {dtype.__name__} numbers")
    try:
        raw = np.asarray(value)
    except (ValueError, TypeError, OverflowError):
        raise wanted from None
    if raw.ndim != 1 or raw.dtype.kind not in "iuf":
        raise wanted
    with np.errstate(invalid="ignore", over="ignore"):
        column: npt.NDArray[np.generic] = raw.astype(dtype)
    if not np.array_equal(column, raw, equal_nan=True):
        raise wanted
    return column
