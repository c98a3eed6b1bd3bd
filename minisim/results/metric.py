"""`Metric`: one column of results, its meaning, and the function that measures it.

What the function takes depends on `needs`, what it returns on `per`:

| needs | takes |
|---|---|
| trips | the `Trips` of a group: the number is also given by lane, movement and kind |
| run and trips | the `Run` with the trips of a group alone, likewise |
| run, counts | the `Run` |
| trajectories | the `Run`, recorded near the junction at least |
| whole trajectories | the `Run`, recorded on all of its roads |
| decisions | the `Run`, whose decisions were timed |

All are without the warm-up (`Run.counted`), except for a metric per lane.

| per | returns |
|---|---|
| trip | one value per trip, NaN for none: averaged by lane, movement and kind |
| lane | values over time, shape (k, lanes): averaged by lane, and their sum over the whole run |
| run | one number, or None |
"""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from minisim.errors import InputError, MinisimError, show
from minisim.parameters import Switch, checked, declared, switch, text, word
from minisim.results.trips import Floats, Trips

if TYPE_CHECKING:
    from minisim.results.run import Run

#: Names that no metric may have: keys of summaries and columns of sweeps.
RESERVED: Final = frozenset({
    "arms", "arrivals", "complete", "controller", "cpu_s", "density", "difference", "error",
    "failed", "growing", "horizon_s", "host", "kind", "kinds", "lane", "lanes", "manoeuvre",
    "movements", "pairs", "profile", "recipe", "runs", "scenario", "seed", "side", "spillback_s",
    "split", "too_short", "turns", "vehicle", "version", "warmup_s",
})  # fmt: skip

#: What a metric can be measured from.
NEEDS: Final = (
    "trips", "run and trips", "run", "trajectories", "whole trajectories", "decisions", "counts",
)  # fmt: skip

#: What trips can be grouped by -> the groups' key in a summary.
GROUPS: Final = {"lane": "lanes", "movement": "movements", "kind": "kinds", "type": "types"}

#: Suffixes of the columns with percentiles (numpy's linear method) and the maximum.
SPREAD: Final = ("p50", "p95", "max")

#: Prefixes and suffixes of columns made from metrics.
BEGINNINGS: Final = ("complete_", *(f"{key}_" for key in GROUPS.values()))
ENDINGS: Final = tuple(f"_{what}" for what in (*SPREAD, "ci95", "pi95"))


def _name(title: str, value: Any) -> Any:
    if not isinstance(value, str) or not value.isidentifier():
        raise InputError(f"{title} must be letters, digits and underscores, got {show(value)}")
    if value in RESERVED or value.startswith(BEGINNINGS) or value.endswith(ENDINGS):
        raise InputError(f"{title} must not be a column of runs, got {value!r}")
    return value


def _function(title: str, value: Any) -> Any:
    if not callable(value):
        raise InputError(f"{title} must be a function, got {show(value)}")
    return value


@declared
class Metric:
    """One metric: its column, its meaning and the function that measures it; see the module."""

    name: str = checked("the column", _name, "identifier", label="name of a metric")
    of: Callable[[Any], Any] = checked(
        "measures it: returns an array with one value per trip (NaN for none) or by time and lane, "
        "or one number (None for none)",
        _function, "function", label="function of a metric",
    )  # fmt: skip
    unit: str = text("such as s", empty=True, default="")
    per: str = word("what has a value", ("trip", "lane", "run"), default="run")
    needs: str = word("measured from", NEEDS, default="run")
    phase: str = word(
        "of a trip, in which a value accumulates: on the road, or before insertion",
        ("drive", "queue"), default="drive",
    )  # fmt: skip
    title: str = text("for headings and axes; empty means its name", empty=True, default="")
    symbol: str = text("in equations", empty=True, default="")
    meaning: str = text("in one line", empty=True, default="")
    equation: str = text("with its source", empty=True, default="")
    grades: str = text(
        "a letter for each value 1, 2, …, by which it is shown", empty=True, default=""
    )
    usual: Switch = switch("whether every summary has it", default=False)

    @property
    def grouped(self) -> bool:
        """Whether each lane has a value of its own."""
        return self.per != "run" or self.needs in ("trips", "run and trips")

    @property
    def heading(self) -> str:
        """Title and unit, such as "waiting [s]"."""
        return f"{self.title or self.name} [{self.unit}]".removesuffix(" []")

    def values(self, subject: Run | Trips, count: int) -> Floats:
        """One value per trip, shape (count,), NaN for none; otherwise `InputError`."""
        given = self._measured(subject)
        values = np.asarray(given)
        if values.shape != (count,) or values.dtype.kind not in "biuf" or np.isinf(values).any():
            raise InputError(
                f"metric {self.name!r} must give one finite number per trip, an array of shape "
                f"({count},), got {show(given)}"
            )
        return np.asarray(values, dtype=float)

    def series(self, run: Run) -> Floats:
        """Values over time by lane, shape (k, lanes); otherwise `InputError`."""
        given, lanes = self._measured(run), run.site.intersection.n
        values = np.asarray(given)
        if values.ndim != 2 or values.shape[1] != lanes or values.dtype.kind not in "biuf":
            raise InputError(
                f"metric {self.name!r} must give one number per time and lane, an array of shape "
                f"(k, {lanes}), got {show(given)}"
            )
        return np.asarray(values, dtype=float)

    def number(self, subject: Run | Trips) -> float | int | None:
        """One number, or None if there is none; raises `InputError` for anything else."""
        given = self._measured(subject)
        if given is None:
            return None
        if not isinstance(given, Real | np.bool_) or math.isinf(given):
            hint = '; per="trip" takes an array' if isinstance(given, np.ndarray) else ""
            raise InputError(
                f"metric {self.name!r} must give one finite number or None, got {show(given)}{hint}"
            )
        if isinstance(given, Integral | np.bool_):
            return int(given)
        return None if math.isnan(given) else float(given)

    def _measured(self, subject: Run | Trips) -> Any:
        try:
            return self.of(subject)
        except (Exception, SystemExit) as error:  # a caller's function may raise anything
            frames = traceback.extract_tb(error.__traceback__)[1:2]
            place = "".join(f" ({Path(it.filename).name}, line {it.lineno})" for it in frames)
            what = f" raised {type(error).__name__}: {error}{place}"
            if isinstance(error, MinisimError):
                what = f": {error}"
            raise InputError(f"metric {self.name!r}{what}") from error
