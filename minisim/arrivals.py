"""Demand, and the arrival table drawn from it before a run: every controller meets the same one."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from minisim.errors import InputError, number, numbers, show
from minisim.junction.movements import ARM_NAMES, Bools
from minisim.parameters import checked, declared, real, word
from minisim.streams import stream

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

MODELS = ("poisson", "exponential", "shifted")
#: Words for equal shares of the lanes and of the manoeuvres.
BALANCED, UNIFORM = "balanced", "uniform"
#: A driver's factor on the speed limit; SUMO cuts its speedFactor to the same range.
LEAST_FACTOR, MOST_FACTOR = 0.2, 2.0
#: More than any lane can carry: a higher density is a mistake.
MAX_DENSITY = 3600.0
#: The chance of more in one second is below 10⁻¹⁶ at any density.
MOST_IN_A_SECOND = 20
#: Seconds, or headways of each lane, drawn at once.
BLOCK, HEADWAYS = 3600, 64
#: Shares as callers may give them.
Shares = Sequence[float] | str | None
#: The longest duration and the latest demand time [s].
MAX_TIME = 1e7


@dataclass(frozen=True, eq=False)
class Arrivals:
    """An arrival table, sorted by demand time and lane; all columns have the shape (k,)."""

    time: Floats  # demand time [s]
    lane: Ints  # index of the approach lane
    manoeuvre: Ints  # 1 … n−1
    speed_factor: Floats | None = None  # drivers' factors on the speed limit; None: they are drawn
    type: npt.NDArray[np.str_] | None = None  # names of the vehicles' types; None: they are drawn

    def __post_init__(self) -> None:
        time = _column("demand_time_s", self.time, np.float64)
        lane = _column("lane", self.lane, np.int64)
        manoeuvre = _column("manoeuvre", self.manoeuvre, np.int64)
        columns: dict[str, npt.NDArray[Any]]
        columns = {"time": time, "lane": lane, "manoeuvre": manoeuvre}
        if self.speed_factor is not None:
            factors = _column("speed_factor", self.speed_factor, np.float64)
            if len(factors) and not LEAST_FACTOR <= factors.min() <= factors.max() <= MOST_FACTOR:
                raise InputError(f"a speed_factor must be {LEAST_FACTOR:g} … {MOST_FACTOR:g}")
            columns["speed_factor"] = factors
        if self.type is not None:
            columns["type"] = np.asarray(self.type, dtype=np.str_)
        if any(len(column) != len(time) for column in columns.values()):
            raise InputError("an arrival table needs as many times as lanes and manoeuvres")
        if not np.isfinite(time).all() or time.min(initial=0.0) < 0:
            raise InputError("demand times must be finite and not negative")
        if (last := time.max(initial=0.0)) > MAX_TIME:
            raise InputError(f"demand times must be at most {MAX_TIME:g} s, got {last:g}")
        order = np.lexsort((lane, time))
        for name, column in columns.items():
            column = column[order]
            column.setflags(write=False)
            object.__setattr__(self, name, column)

    def __len__(self) -> int:
        return len(self.time)

    @cached_property
    def rank(self) -> Ints:
        """Each vehicle's place among those of its lane, from 0.

        Random traits, such as a human driver, are drawn by lane and rank, so they do not
        depend on other lanes or on the horizon.
        """
        return ranks(self.lane)

    def between(self, start: float, end: float) -> Arrivals:
        """The arrivals from `start` [s] to before `end`, with times counted from `start`."""
        here = slice(*self.time.searchsorted((start, end)))
        factors = None if self.speed_factor is None else self.speed_factor[here]
        types = None if self.type is None else self.type[here]
        return Arrivals(
            self.time[here] - start, self.lane[here], self.manoeuvre[here], factors, types
        )

    def check(self, n: int, allowed: Bools | None = None) -> None:
        """Raise `InputError` for a lane or manoeuvre that does not exist with n arms.

        Or for one that no vehicle may take there, if `allowed` is given, shape (n, n−1).
        """
        for bad in self.lane[(self.lane < 0) | (self.lane >= n)].tolist():
            name = ARM_NAMES[bad] if 0 <= bad < len(ARM_NAMES) else str(bad)
            raise InputError(f"lane {name} is not in the geometry (lanes a … {ARM_NAMES[n - 1]})")
        for bad in self.manoeuvre[(self.manoeuvre < 1) | (self.manoeuvre >= n)].tolist():
            raise InputError(f"manoeuvre {bad} does not exist with {n} arms (1 … {n - 1})")
        if allowed is not None:
            for bad in np.flatnonzero(~allowed[self.lane, self.manoeuvre - 1]).tolist():
                raise InputError(
                    f"the vehicle of {self.time[bad]:g} s takes {ARM_NAMES[self.lane[bad]]}"
                    f"{self.manoeuvre[bad]}, which is forbidden here or against a one-way road"
                )

    def rates(self, n: int, horizon: float) -> tuple[float, ...]:
        """Mean inflow of each lane over the first `horizon` seconds [veh/h]."""
        counts = np.bincount(self.lane[self.time < horizon], minlength=n)
        return tuple(float(c) * 3600.0 / horizon for c in counts)


def read_shares(name: str, value: object, equal: str) -> tuple[float, ...] | None:
    """Shares given as numbers, or as text such as "4:3:2:1" or "(4, 3, 2, 1)".

    None and the word `equal` mean equal shares, which are returned as None.

    Raises:
        InputError: not finite numbers, a negative one, or only zeros.
    """
    if value is None or (isinstance(value, str) and value == equal):
        return None
    if isinstance(value, str):
        text = value.strip()
        listed = text[1:-1] if text[:1] + text[-1:] in ("()", "[]") else text
        try:
            value = tuple(map(float, re.split("[:,]", listed)))
        except ValueError:
            wrong = f"{name} must be {equal} or like 4:3:2:1, got {show(value)}"
            raise InputError(wrong) from None
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

    Shares are kept as `read_shares` returns them. All models of arrivals have the same mean
    headway. The paper's is Poisson: it draws a count of arrivals for every second.
    """

    density: float = real(
        "mean inflow per lane that vehicles may come on; with a split, the mean over these",
        "veh/h/lane",
        low=0, high=MAX_DENSITY,
    )  # fmt: skip
    split: Shares = checked(
        "shares of the lanes",
        partial(read_shares, equal=BALANCED), f"shares such as 4:3:2:1 | {BALANCED}", default=None,
    )  # fmt: skip
    turns: Shares = checked(
        "shares of the manoeuvres 1 … n−1, the same on every lane, among those allowed there",
        partial(read_shares, equal=UNIFORM), f"shares such as 1:2:1 | {UNIFORM}", default=None,
    )  # fmt: skip
    model: str = word(
        "of the arrivals: poisson counts, exponential headways, or headways shifted by min_headway",
        MODELS, default="poisson", label="arrival model",
    )  # fmt: skip
    min_headway: float = real("of the shifted model", "s", default=1.5, low=0, high=60)

    def rates(self, n: int, allowed: Bools | None = None) -> tuple[float, ...]:
        """Mean inflow of each of n lanes [veh/h]; 0 where none of the manoeuvres is `allowed`."""
        shares = _shares("split", self.split, n, "lanes")
        used = n
        if allowed is not None:
            lanes = np.asarray(allowed.any(axis=1))
            shares, used = _open_shares(shares, lanes, even=self.split is None), int(lanes.sum())
        rates = tuple(self.density * used * share for share in shares)
        if max(rates) > MAX_DENSITY:
            most = f"at most {MAX_DENSITY:g} are allowed"
            raise InputError(f"the split gives a lane {max(rates):g} veh/h; {most}")
        if self.model == "shifted" and max(rates) / 3600.0 * self.min_headway >= 1.0:
            raise InputError(
                f"{max(rates):g} veh/h leave no room for a min_headway of {self.min_headway:g} s"
            )
        return rates

    def draw(self, n: int, duration: float, seed: int, allowed: Bools | None = None) -> Arrivals:
        """Draw the arrivals on n lanes over `duration` seconds, on manoeuvres that are `allowed`.

        Each random number belongs to one lane and one second or vehicle, so a longer duration only
        adds arrivals, and a lane's arrivals do not depend on the rates of the others.

        Manoeuvres are drawn independently. (The authors drew them without replacement within a
        second, which ends the run if more vehicles come than there are manoeuvres: at 350
        veh/h/lane, in 0.4 % of the lane-seconds.)
        """
        number("duration [s]", duration, above=0, high=MAX_TIME)
        turns = _shares("turns", self.turns, n - 1, "manoeuvres")
        rates = np.array(self.rates(n, allowed)) / 3600.0
        rng = stream(seed, "arrivals")
        if self.model == "poisson":
            time, lane = _counted(rates, duration, rng)
        else:
            shift = self.min_headway if self.model == "shifted" else 0.0
            time, lane = _spaced(rates, shift, duration, rng)
        rank = ranks(lane)
        draws = stream(seed, "manoeuvres").random((rank.max(initial=-1) + 1, n))
        bounds = np.cumsum(_open_turns(np.tile(turns, (n, 1)), allowed), axis=1)
        bounds = (bounds / bounds[:, -1:])[lane]
        return Arrivals(time, lane, (bounds <= draws[rank, lane, None]).sum(axis=1) + 1)


def _counted(rates: Floats, duration: float, rng: np.random.Generator) -> tuple[Floats, Ints]:
    """Times and lanes of Poisson counts for every second, by inversion; `rates` [veh/s], (n,)."""
    k = np.arange(MOST_IN_A_SECOND)
    chances = np.exp(-rates)[:, None] * rates[:, None] ** k / np.cumprod(np.maximum(k, 1))
    at_most = chances.cumsum(axis=1)  # chance of at most k vehicles in a second, (n, k)
    times: list[Floats] = []
    lanes: list[Ints] = []
    for start in range(0, math.ceil(duration), BLOCK):
        draws = rng.random((min(BLOCK, math.ceil(duration) - start), len(rates)))
        second, lane = np.nonzero(draws >= at_most[:, 0])
        counts = (draws[second, lane, None] >= at_most[lane]).sum(axis=1)
        times.append(np.repeat(start + second, counts).astype(float))
        lanes.append(np.repeat(lane, counts))
    return np.concatenate(times), np.concatenate(lanes)


def _spaced(
    rates: Floats, shift: float, duration: float, rng: np.random.Generator
) -> tuple[Floats, Ints]:
    """Times and lanes with exponential headways beyond `shift` [s]; `rates` [veh/s], (n,)."""
    with np.errstate(divide="ignore"):
        mean = 1.0 / rates - shift  # infinite on a lane without arrivals
    blocks = [np.zeros((1, len(rates)))]
    while blocks[-1][-1].min() < duration:
        headways = shift + mean * rng.standard_exponential((HEADWAYS, len(rates)))
        blocks.append(blocks[-1][-1] + headways.cumsum(axis=0))
    times = np.concatenate(blocks[1:])
    row, lane = np.nonzero(times < duration)
    return times[row, lane], lane


def ranks(lane: Ints) -> Ints:
    """`Arrivals.rank`, given the lanes in order of demand."""
    order = np.argsort(lane, kind="stable")
    ahead = np.searchsorted(lane[order], lane[order])
    rank = np.empty(len(lane), int)
    rank[order] = np.arange(len(lane)) - ahead
    return rank


def _shares(name: str, given: Shares, count: int, things: str) -> tuple[float, ...]:
    """Shares of `count` things, summing to 1."""
    if given is None:
        return (1.0 / count,) * count
    shares = tuple(map(float, given))  # `Demand` has already turned text into numbers
    if len(shares) != count:
        raise InputError(f"{name} has {len(shares)} shares for {count} {things}")
    return tuple(share / sum(shares) for share in shares)


def _open_shares(shares: tuple[float, ...], lanes: Bools, *, even: bool) -> tuple[float, ...]:
    """Shares of the lanes that vehicles may come on; `even` shares are divided among these."""
    for lane in np.flatnonzero(~lanes & (np.array(shares) > 0.0)).tolist():
        if not even:
            raise InputError(
                f"split gives lane {ARM_NAMES[lane]} a share, but no vehicle may come from there: "
                "its share must be 0"
            )
    return tuple(
        (1.0 / int(lanes.sum()) if even else share) * used
        for share, used in zip(shares, lanes.tolist(), strict=True)
    )


def _open_turns(turns: Floats, allowed: Bools | None) -> Floats:
    """Shares of the manoeuvres of each lane, shape (n, n−1), without those not allowed."""
    if allowed is None:
        return turns
    kept = np.where(allowed, turns, 0.0)
    for lane in np.flatnonzero(allowed.any(axis=1) & (kept.sum(axis=1) == 0.0)).tolist():
        raise InputError(f"turns leave lane {ARM_NAMES[lane]} none of the manoeuvres allowed there")
    return np.where(allowed.any(axis=1, keepdims=True), kept, 1.0)  # no vehicle draws the latter


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
