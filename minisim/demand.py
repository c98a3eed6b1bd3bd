"""How many vehicles come, from where and where to: constant, or by time of day."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache, partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from minisim.arrivals import Arrivals, ranks
from minisim.clock import seconds_of, time_of_day
from minisim.errors import InputError, instance, items, number, show
from minisim.fleet import Fleet, FleetLike, fleet_named
from minisim.inflow import MAX_DENSITY, MAX_TIME, Floats, Inflow, counted, spaced
from minisim.junction.movements import ARM_NAMES, Bools
from minisim.parameters import Reals, Takes, checked, declared, real, reals, text, word
from minisim.shares import (
    BALANCED,
    UNIFORM,
    Shares,
    Turns,
    lane_shares,
    read_shares,
    read_turns,
    shares_text,
    turning,
    turns_text,
)
from minisim.streams import stream
from minisim.vehicle import VehicleType

MODELS = ("poisson", "exponential", "shifted")


class Spell(NamedTuple):
    """A part of a run in which inflow and turns stay the same."""

    start: float  # of the run [s]
    rates: tuple[float, ...]  # mean inflow of each lane [veh/h]
    turns: Turns  # as `read_turns` returns them
    name: str = ""  # what messages add to tell it from others


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

    def spells(self, n: int, allowed: Bools | None = None) -> Sequence[Spell]:
        """What comes on n lanes, from the start of a run on; the last spell has no end.

        `allowed` says which manoeuvres vehicles may take, shape (n, n−1); None is all. Raises
        `InputError` if there are other lanes, or inflow on a lane without any such manoeuvre.
        """
        raise NotImplementedError  # by Demand and DemandProfile

    @property
    def duration(self) -> float:
        """How long it lasts [s]."""
        return math.inf

    def inflow(self, n: int, allowed: Bools | None = None) -> Inflow:
        """The inflow of n lanes; raises as `spells`, and for more than a lane can carry."""
        spells = self.spells(n, allowed)
        most = max(max(spell.rates) for spell in spells)
        if self.model == "shifted" and most / 3600.0 * self.min_headway >= 1.0:
            room = f"no room for a min_headway of {self.min_headway:g} s"
            raise InputError(f"{most:g} veh/h leave {room}")
        return Inflow(tuple(it.start for it in spells), tuple(it.rates for it in spells))

    def turning(self, n: int, allowed: Bools | None = None) -> Floats:
        """Shares of the manoeuvres by spell and lane, shape (p, n, n−1).

        Raises as `spells` and `minisim.shares.turning`.
        """
        spells = self.spells(n, allowed)
        return np.array([turning(f"turns{it.name}", it.turns, n, allowed) for it in spells])

    def check(self, n: int, duration: float, allowed: Bools | None = None) -> None:
        """Raise `InputError` if it is not for n lanes, or ends before `duration` [s]."""
        self.inflow(n, allowed)
        self.turning(n, allowed)
        if duration > self.duration:
            end = f"ends {self.duration:g} s after its start"
            raise InputError(f"the demand {end}, before the run of {duration:g} s")

    def draw(self, n: int, duration: float, seed: int, allowed: Bools | None = None) -> Arrivals:
        """Draw the arrivals on n lanes over `duration` seconds, on manoeuvres that are `allowed`.

        Each random number belongs to one lane and one second or vehicle. So what comes before a
        time does not depend on what comes after, nor one lane on another: a longer duration only
        adds arrivals.

        Manoeuvres are drawn independently. (The authors drew them without replacement within a
        second, which ends the run if more vehicles come than there are manoeuvres: at 350
        veh/h/lane, in 0.4 % of the lane-seconds.)
        """
        duration = number("duration [s]", duration, above=0, high=MAX_TIME)
        inflow, bounds = _laid_out(
            self, n, duration, None if allowed is None else allowed.tobytes()
        )
        rng = stream(seed, "arrivals")
        if self.model == "poisson":
            time, lane = counted(inflow, duration, rng)
        else:
            shift = self.min_headway if self.model == "shifted" else 0.0
            time, lane = spaced(inflow, shift, duration, rng)
        rank = ranks(lane)
        draws = stream(seed, "manoeuvres").random((rank.max(initial=-1) + 1, n))[rank, lane]
        passed = bounds[inflow.period(time), lane] <= draws[:, None]
        return Arrivals(time, lane, passed.sum(axis=1) + 1)


@lru_cache(maxsize=64)
def _laid_out(
    demand: ArrivalModel, n: int, duration: float, allowed: bytes | None
) -> tuple[Inflow, Floats]:
    """The inflow, and where each manoeuvre's share ends, (p, n, n−1), after `check`."""
    open_ = None if allowed is None else np.frombuffer(allowed, bool).reshape(n, n - 1)
    demand.check(n, duration, open_)
    bounds = np.cumsum(demand.turning(n, open_), axis=2)
    bounds /= bounds[..., -1:].copy()
    bounds.setflags(write=False)
    return demand.inflow(n, open_), bounds


@declared(kw_only=True)
class Demand(ArrivalModel):
    """How many vehicles come, from where, and where to; the same at any time.

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
        """What rows and files say of the shares of the lanes and of the manoeuvres."""
        return shares_text(self.split, BALANCED), turns_text(self.turns)

    def spells(self, n: int, allowed: Bools | None = None) -> Sequence[Spell]:
        """As of `ArrivalModel`: one."""
        lanes = np.ones(n, bool) if allowed is None else np.asarray(allowed.any(axis=1))
        inflow = self.density * int(lanes.sum())
        rates = tuple(inflow * share for share in lane_shares(self.split, lanes))
        if max(rates) > MAX_DENSITY:
            most = f"at most {MAX_DENSITY:g} are allowed"
            raise InputError(f"the split gives a lane {max(rates):g} veh/h; {most}")
        return [Spell(0.0, rates, self.turns)]


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
    fleet: Takes[Fleet | None, FleetLike | None] = checked(
        "types of the vehicles, as counted; none is the profile's vehicle",
        lambda _, value: fleet_named(value, VehicleType()), "fleet such as car:0.8,bus:0.2",
        optional=True, default=None,
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
        if self.fleet is not None:
            self.fleet.check(len(first.rates))

    @property
    def words(self) -> tuple[str, str]:
        """What rows say instead of shares: its name."""
        return self.name, self.name

    @property
    def duration(self) -> float:
        """From `start` to the end of the last period [s]."""
        return float(self.periods[-1].end - self.start)

    def spells(self, n: int, allowed: Bools | None = None) -> Sequence[Spell]:
        """As of `ArrivalModel`: the periods that end after `start`."""
        ahead = [period for period in self.periods if period.end > self.start]
        for period in ahead:
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
        return [
            Spell(max(it.start - self.start, 0.0), it.rates, it.turns, f" of {it}") for it in ahead
        ]
