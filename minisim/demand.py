"""How many vehicles come, from where and where to: constant, or by time of day."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np

from minisim.arrivals import Arrivals, ranks
from minisim.clock import seconds_of, time_of_day
from minisim.errors import InputError, instance, items, number, numbers, show
from minisim.inflow import MAX_DENSITY, MAX_TIME, Floats, Inflow, counted, spaced
from minisim.junction.movements import ARM_NAMES, Bools
from minisim.parameters import Reals, Takes, checked, declared, real, reals, text, word
from minisim.streams import stream

MODELS = ("poisson", "exponential", "shifted")
#: Words for equal shares of the lanes and of the manoeuvres.
BALANCED, UNIFORM = "balanced", "uniform"
#: Shares as callers may give them.
Shares = Sequence[float] | str | None
#: Shares of the manoeuvres: the same on every lane, or a row for each.
Turns = Shares | Sequence[Shares]


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


def read_turns(name: str, value: object) -> Any:
    """Shares of the manoeuvres as for `read_shares`, or a row of them per lane.

    As text, rows are apart by slashes: "1:2:1/uniform/0:1:1/1:2:1". Raises as `read_shares`.
    """
    rows: Any = value.split("/") if isinstance(value, str) and "/" in value else value
    if isinstance(rows, list | tuple) and any(
        it is None or np.ndim(it) or _text(it) for it in rows
    ):
        return tuple(read_shares(f"{name}[{k}]", row, UNIFORM) for k, row in enumerate(rows))
    return read_shares(name, value, UNIFORM)


def shares_text(shares: Shares, equal: str) -> str:
    """Shares as `read_shares` returns them, as text such as "4:3:2:1" or the word `equal`."""
    return equal if shares is None else ":".join(f"{float(share):g}" for share in shares)


def turns_text(turns: Any) -> str:
    """Turns as `read_turns` returns them, as text."""
    rows = turns if _by_lane(turns) else (turns,)
    return "/".join(shares_text(row, UNIFORM) for row in rows)


@declared(kw_only=True)
class ArrivalModel:
    """How vehicles come, given how many: the parent of `Demand` and `DemandProfile`.

    All models have the same mean headway. The paper's is Poisson: it draws a count of arrivals for
    every second.
    """

    model: str = word(
        "of the arrivals: poisson counts, exponential headways, or headways shifted by min_headway",
        MODELS, default="poisson", label="arrival model",
    )  # fmt: skip
    min_headway: float = real("of the shifted model", "s", default=1.5, low=0, high=60)

    @property
    def words(self) -> tuple[str, str]:
        """What rows say of the shares of the lanes and of the manoeuvres."""
        raise NotImplementedError  # Demand and DemandProfile each know it

    def inflow(self, n: int, allowed: Bools | None = None) -> Inflow:
        """The inflow of n lanes, 0 where none of the manoeuvres is `allowed`, shape (n, n−1).

        Raises `InputError` if it does not fit the lanes, or is more than possible.
        """
        raise NotImplementedError  # Demand and DemandProfile each know it

    def turns_of_periods(self) -> dict[str, Any]:
        """What messages call the turns of each period -> the turns, as `read_turns` gives them."""
        raise NotImplementedError  # Demand and DemandProfile each know it

    def turning(self, n: int, allowed: Bools | None = None) -> Floats:
        """Shares of the manoeuvres that are allowed, by period and lane, shape (p, n, n−1).

        Raises `InputError` if they do not fit the lanes, leave one nothing that is allowed, or, if
        given by lane, have a share of what is not.
        """
        given = self.turns_of_periods()
        shares = np.array([_turning(name, turns, n) for name, turns in given.items()])
        if allowed is None:
            return shares
        for name, turns in given.items():
            for lane, row in enumerate(turns if _by_lane(turns) else ()):
                if row is not None and (np.array(row)[~allowed[lane]] > 0.0).any():
                    raise InputError(
                        f"{name} send vehicles of lane {ARM_NAMES[lane]} where none may go"
                    )
        return _open_turns(shares, allowed)

    @property
    def duration(self) -> float:
        """How long it lasts [s]."""
        return math.inf

    def check(self, n: int, duration: float, allowed: Bools | None = None) -> None:
        """Raise `InputError` if it is not for n lanes, or ends before `duration` [s]."""
        self.inflow(n, allowed)
        self.turning(n, allowed)
        if duration > self.duration:
            raise InputError(
                f"the demand {self.words[0]!r} ends {self.duration:g} s after the start, before "
                f"the run of {duration:g} s"
            )

    def draw(self, n: int, duration: float, seed: int, allowed: Bools | None = None) -> Arrivals:
        """Draw the arrivals on n lanes over `duration` seconds, on manoeuvres that are `allowed`.

        Each random number belongs to one lane and one second or vehicle. So what comes before a
        time does not depend on what comes after, nor one lane on another: a longer duration only
        adds arrivals.

        Manoeuvres are drawn independently. (The authors drew them without replacement within a
        second, which ends the run if more vehicles come than there are manoeuvres: at 350
        veh/h/lane, in 0.4 % of the lane-seconds.)
        """
        number("duration [s]", duration, above=0, high=MAX_TIME)
        self.check(n, duration, allowed)
        inflow, turning = self.inflow(n, allowed), self.turning(n, allowed)
        rng = stream(seed, "arrivals")
        if self.model == "poisson":
            time, lane = counted(inflow, duration, rng)
        else:
            shift = self.min_headway if self.model == "shifted" else 0.0
            time, lane = spaced(inflow, shift, duration, rng)
        rank = ranks(lane)
        draws = stream(seed, "manoeuvres").random((rank.max(initial=-1) + 1, n))[rank, lane]
        bounds = np.cumsum(turning, axis=2)
        bounds = (bounds / bounds[..., -1:])[inflow.period(time), lane]
        return Arrivals(time, lane, (bounds <= draws[:, None]).sum(axis=1) + 1)

    def _fit(self, rates: tuple[float, ...], what: str) -> tuple[float, ...]:
        """Return rates that a lane can carry under the model; `what` gives them."""
        if max(rates) > MAX_DENSITY:
            most = f"at most {MAX_DENSITY:g} are allowed"
            raise InputError(f"{what} gives a lane {max(rates):g} veh/h; {most}")
        if self.model == "shifted" and max(rates) / 3600.0 * self.min_headway >= 1.0:
            raise InputError(
                f"{max(rates):g} veh/h leave no room for a min_headway of {self.min_headway:g} s"
            )
        return rates


@declared(kw_only=True)
class Demand(ArrivalModel):
    """How many vehicles come, from where, and where to, at any time alike.

    Shares are kept as `read_shares` and `read_turns` return them.
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
    turns: Turns = checked(
        "shares of the manoeuvres 1 … n−1, the same on every lane among those allowed there, or a "
        "row for each",
        read_turns, f"shares such as 1:2:1 or 1:2:1/0:1:1/… | {UNIFORM}", default=None,
    )  # fmt: skip

    @property
    def words(self) -> tuple[str, str]:
        """As of `ArrivalModel`: as in files."""
        return shares_text(self.split, BALANCED), turns_text(self.turns)

    def rates(self, n: int, allowed: Bools | None = None) -> tuple[float, ...]:
        """Mean inflow of each of n lanes [veh/h]; 0 where none of the manoeuvres is `allowed`."""
        shares = _shares("split", self.split, n, "lanes")
        used = n
        if allowed is not None:
            lanes = np.asarray(allowed.any(axis=1))
            shares, used = _open_shares(shares, lanes, even=self.split is None), int(lanes.sum())
        return self._fit(tuple(self.density * used * share for share in shares), "the split")

    def inflow(self, n: int, allowed: Bools | None = None) -> Inflow:
        """As of `ArrivalModel`: one period."""
        return Inflow((0.0,), (self.rates(n, allowed),))

    def turns_of_periods(self) -> dict[str, Any]:
        """As of `ArrivalModel`: one period."""
        return {"turns": self.turns}


def _whole(title: str, value: object) -> int:
    time = seconds_of(value, title)
    if not time.is_integer():
        raise InputError(f"{title} must be whole seconds, got {show(value)}")
    return int(time)


def _periods(title: str, value: object) -> tuple[Period, ...]:
    periods = tuple(items(title, value, "Periods"))
    for one in periods:
        instance(title, one, Period)
    if not periods:
        raise InputError("a demand profile needs at least one period")
    for one, other in pairwise(periods):
        if other.start != one.end:
            how = "overlaps the next" if other.start < one.end else "leaves a hole before the next"
            raise InputError(f"the period {one} {how}, {other}")
        if len(other.rates) != len(one.rates):
            lanes = f"{len(one.rates)} rates, the next {len(other.rates)}"
            raise InputError(f"the period {one} has {lanes}; a rate per lane is needed in each")
    return periods


@declared(kw_only=True)
class Period:
    """A time of day with one inflow, such as a quarter of an hour of a count."""

    start: Takes[int, int | str] = checked(
        "its start", _whole, "time of day such as 07:00 | whole seconds"
    )
    end: Takes[int, int | str] = checked(
        "its end", _whole, "time of day such as 07:15 | whole seconds"
    )
    rates: Reals[tuple[float, ...]] = reals(
        "mean inflow of each lane", "veh/h", low=0, high=MAX_DENSITY
    )
    turns: Turns = checked(
        "shares of the manoeuvres 1 … n−1, the same on every lane or a row for each",
        read_turns, f"shares such as 1:2:1 or 1:2:1/0:1:1/… | {UNIFORM}", default=None,
    )  # fmt: skip

    def __post_init__(self) -> None:
        if self.end <= self.start:
            raise InputError(f"the period {self} must end after its start")
        if len(self.rates) < 3:
            raise InputError(f"the period {self} needs a rate per lane, got {len(self.rates)}")

    def __str__(self) -> str:
        return f"{time_of_day(self.start)}-{time_of_day(self.end)}"


@declared(kw_only=True)
class DemandProfile(ArrivalModel):
    """Demand by time of day: inflow and turns that are constant within a period.

    A run begins at `start`, which is its time 0, and must end no later than the last period.
    """

    name: str = text("what rows call it", default="profile")
    periods: tuple[Period, ...] = checked(
        "one after the other, without holes", _periods, "Periods"
    )  # fmt: skip
    start: Takes[int, float | str | None] = checked(
        "time of day at which a run begins; none is the start of the first period",
        lambda _, value: _whole("start", value), "time of day such as 07:00 | whole seconds",
        optional=True, default=None,
    )  # fmt: skip

    def __post_init__(self) -> None:
        first, last = self.periods[0], self.periods[-1]
        if self.start is None:
            object.__setattr__(self, "start", first.start)
        if not first.start <= self.start < last.end:
            known = f"{time_of_day(first.start)} to {time_of_day(last.end)}"
            raise InputError(f"start is {time_of_day(self.start)}, but the demand is from {known}")

    @property
    def words(self) -> tuple[str, str]:
        """As of `ArrivalModel`: its name."""
        return self.name, self.name

    @property
    def duration(self) -> float:
        """From `start` to the end of the last period [s]."""
        return float(self.periods[-1].end - self.start)

    @cached_property
    def ahead(self) -> tuple[Period, ...]:
        """The periods of a run: those that end after `start`."""
        return tuple(period for period in self.periods if period.end > self.start)

    def inflow(self, n: int, allowed: Bools | None = None) -> Inflow:
        """As of `ArrivalModel`."""
        starts = tuple(max(period.start - self.start, 0.0) for period in self.ahead)
        for period in self.ahead:
            if len(period.rates) != n:
                raise InputError(
                    f"the demand {self.name!r} has {len(period.rates)} lanes, the junction has {n}"
                )
            for lane, rate in enumerate(period.rates):
                if rate and allowed is not None and not allowed[lane].any():
                    raise InputError(
                        f"the demand {self.name!r} has vehicles from lane {ARM_NAMES[lane]}, but "
                        "none may come from there"
                    )
        return Inflow(starts, tuple(self._fit(p.rates, f"the period {p}") for p in self.ahead))

    def turns_of_periods(self) -> dict[str, Any]:
        """As of `ArrivalModel`."""
        return {f"turns of {period}": period.turns for period in self.ahead}


def _text(value: object) -> bool:
    return isinstance(value, str)


def _by_lane(turns: Any) -> bool:
    return turns is not None and any(row is None or isinstance(row, tuple) for row in turns)


def _turning(name: str, turns: Any, n: int) -> list[tuple[float, ...]]:
    """Shares of the manoeuvres on each of n lanes."""
    if not _by_lane(turns):
        return [_shares(name, turns, n - 1, "manoeuvres")] * n
    if len(turns) != n:
        raise InputError(f"{name} has {len(turns)} rows for {n} lanes")
    return [
        _shares(f"{name} on lane {lane}", row, n - 1, "manoeuvres")
        for lane, row in zip(ARM_NAMES, turns, strict=False)
    ]


def _shares(name: str, given: Shares, count: int, things: str) -> tuple[float, ...]:
    """Shares of `count` things, summing to 1."""
    if given is None:
        return (1.0 / count,) * count
    shares = tuple(map(float, given))  # the fields have already turned text into numbers
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


def _open_turns(turning: Floats, allowed: Bools) -> Floats:
    """Shares of the manoeuvres, shape (p, n, n−1), without those not allowed."""
    kept, lanes = np.where(allowed, turning, 0.0), np.asarray(allowed.any(axis=1))
    for lane in np.flatnonzero(lanes & (kept.sum(axis=2) == 0.0).any(axis=0)).tolist():
        raise InputError(f"turns leave lane {ARM_NAMES[lane]} none of the manoeuvres allowed there")
    return np.where(lanes[:, None], kept, 1.0)  # no vehicle draws the latter
