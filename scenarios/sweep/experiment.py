"""One experiment: what is run, the key under which a store knows it, and the row that it gives."""

from __future__ import annotations

import hashlib
import inspect
import json
import math
import platform
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from numbers import Integral, Real
from typing import Any, NamedTuple

import numpy as np

from minisim.control import Controller
from minisim.errors import InputError, MinisimError, choice, instance, integer, show
from minisim.hosting import ON_COLLISION
from minisim.junction.geometry import ARM_NAMES
from minisim.results.trips import Trips
from minisim.version import __version__
from scenarios.mixing import driver_means
from scenarios.scenario import Scenario
from scenarios.statistics import growing, queue_growth

#: Raised by one whenever the same experiment gives another row than before, while the version of
#: the package stays: rows of older results are then computed again.
RESULTS = 2

#: Columns that a repetition of the same run measures anew.
MEASURED = ("cpu_s",)

#: Packages whose code `RESULTS` speaks for.
OURS = ("minisim", "dim", "baselines", "scenarios")

Row = dict[str, Any]


def results_version() -> str:
    """What rows depend on besides their experiment."""
    return f"{__version__}/{RESULTS}"


class Outcome(NamedTuple):
    """What a run left: its row, and where that came from."""

    row: Row
    provenance: dict[str, str]


@dataclass(frozen=True)
class Experiment:
    """One run to be made: what is simulated, who decides, and the seed.

    Attributes:
        scenario, controller, seed: of the run.
        label: what rows call the controller; empty is its own name.
        on_collision: "stop" makes a run that collides a failed one, "record" counts and goes on.
    """

    scenario: Scenario
    controller: Controller
    seed: int = 0
    label: str = ""
    on_collision: str = "stop"

    def __post_init__(self) -> None:
        instance("scenario", self.scenario, Scenario)
        if isinstance(self.controller, type) or not isinstance(self.controller, Controller):
            missing = [part for part in ("name", "start") if not hasattr(self.controller, part)]
            lack = f", which has no {' and no '.join(missing)}" if missing else ", which is a class"
            raise InputError(f"controller must be a Controller, got {show(self.controller)}{lack}")
        integer("seed", self.seed, low=0)
        instance("label", self.label, str)
        choice("on_collision", self.on_collision, ON_COLLISION)

    @property
    def name(self) -> str:
        """What rows call the controller."""
        return self.label or self.controller.name

    @property
    def description(self) -> str:
        """Every parameter as JSON: two experiments are the same when their descriptions are.

        Raises:
            InputError: a controller that is not made of dataclasses, numbers, texts and arrays.
        """
        return json.dumps(canonical(self), separators=(",", ":"), allow_nan=True)

    @property
    def key(self) -> str:
        """What a store knows it by."""
        return key_of(self.description)

    def identity(self) -> Row:
        """The columns that tell what was run."""
        scenario = self.scenario
        demand, intersection = scenario.demand, scenario.intersection
        recorded = scenario.recorded is not None
        return {
            "controller": self.name,
            "scenario": scenario.name,
            "arms": intersection.n,
            "side": intersection.side,
            "profile": scenario.profile.name,
            "density": scenario.density,
            "split": "recorded" if recorded else _shares(demand.split, "balanced"),
            "turns": "recorded" if recorded else _shares(demand.turns, "uniform"),
            "seed": self.seed,
            "horizon_s": scenario.horizon,
        }


def key_of(description: str) -> str:
    """SHA-256 of a description."""
    return hashlib.sha256(description.encode()).hexdigest()


def canonical(value: object) -> Any:
    """The parameters of a recipe as JSON values, alike for equal recipes.

    Dataclasses become their class and fields, those of others also what tells versions of their
    code apart (`_code`), numbers floats (350 and 350.0 are the same density),
    arrays their type, shape and SHA-256.

    Raises:
        InputError: anything else, since what cannot be compared cannot be found again.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, Integral | Real):
        return _canonical_number(value)
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        plain = np.ascontiguousarray(value, dtype=value.dtype.newbyteorder("<"))
        digest = hashlib.sha256(plain.tobytes()).hexdigest()
        return {"array": plain.dtype.str, "shape": list(plain.shape), "sha256": digest}
    if is_dataclass(value) and not isinstance(value, type):
        kind = type(value)
        return {
            "class": f"{kind.__module__}.{kind.__qualname__}",
            **_code(kind),
            **{field.name: canonical(getattr(value, field.name)) for field in fields(value)},
        }
    if isinstance(value, tuple | list):
        return [canonical(item) for item in value]
    if isinstance(value, Mapping):
        pairs = [[canonical(key), canonical(item)] for key, item in value.items()]
        return {"mapping": sorted(pairs, key=json.dumps)}
    if isinstance(value, set | frozenset):
        return {"set": sorted((canonical(item) for item in value), key=json.dumps)}
    raise InputError(
        f"{show(value)} cannot be stored: experiments are made of dataclasses, numbers, texts, "
        "arrays and collections of them"
    )


@cache
def _code(kind: type) -> dict[str, Any]:
    """What tells versions of a class apart: its `version`, or else the text of its modules.

    Nothing for our own classes, whose rows have the version of the results. A recipe's rules are
    in its session as a rule, so the whole file counts; what that imports does not.

    Raises:
        InputError: no version, and no file, as in an interactive session.
    """
    modules = sorted({
        parent.__module__
        for parent in kind.__mro__
        if parent.__module__.partition(".")[0] not in sys.stdlib_module_names | {*OURS}
    })  # fmt: skip
    if not modules:
        return {}
    version = getattr(kind, "version", None)
    if isinstance(version, str | int):
        return {"version": canonical(version)}
    try:
        texts = "".join(inspect.getsource(sys.modules[name]) for name in modules)
    except (OSError, TypeError, KeyError) as error:
        raise InputError(
            f"{kind.__qualname__} cannot be stored, for its code is in no file by which a changed "
            "one could be told: give the class a text or an integer `version`"
        ) from error
    return {"code": hashlib.sha256(texts.encode()).hexdigest()}


def _canonical_number(value: Real | Integral) -> float | str:
    number = float(value)
    return number + 0.0 if number == value or math.isnan(number) else str(value)


def run_experiment(experiment: Experiment) -> Outcome:
    """Run one experiment; a `MinisimError` becomes part of the row."""
    from minisim.simulation import simulate

    scenario, controller = experiment.scenario, experiment.controller
    began = time.thread_time()
    try:
        run = simulate(scenario, controller, experiment.seed, on_collision=experiment.on_collision)
    except MinisimError as error:
        return failed(experiment, error)
    cpu = time.thread_time() - began
    identity = experiment.identity()
    summary = {key: value for key, value in _flat(run.summary()) if key not in identity}
    row = {
        **identity,
        **summary,
        **dict(_flat(driver_means(run))),
        **_growth(run.columns, scenario.intersection.n),
        "arrivals": _fingerprint(run.columns),
        "cpu_s": cpu,
        "version": results_version(),
        "error": None,
    }
    return Outcome(row, _provenance())


def failed(experiment: Experiment, error: BaseException) -> Outcome:
    """The outcome of a run that gave none."""
    kind = "" if isinstance(error, MinisimError) else f"{type(error).__name__}: "
    row = {**experiment.identity(), "version": results_version(), "error": f"{kind}{error}"}
    return Outcome(row, _provenance())


def _growth(trips: Trips, n: int) -> Row:
    """Growth of the queues, total and by lane, and whether it is more than chance."""
    demanded = trips.demand_time <= trips.end
    leave = np.where(trips.arrived, trips.arrival, math.inf)

    def of(chosen: Any) -> tuple[float, int]:
        grown = queue_growth(trips.demand_time[chosen], leave[chosen], trips.end)
        return grown, int(chosen.sum())

    lanes = [of(demanded & (trips.lane == lane)) for lane in range(n)]
    total = of(demanded)
    return {
        "queue_growth": total[0],
        **{f"lanes_{ARM_NAMES[i]}_queue_growth": grown for i, (grown, _) in enumerate(lanes)},
        "growing": any(growing(*tested) for tested in (total, *lanes)),
    }


def _fingerprint(trips: Trips) -> str:
    """Names the arrivals: rows of common arrivals have the same."""
    digest = hashlib.sha256()
    for column in (trips.demand_time, trips.lane, trips.manoeuvre):
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()[:16]


def _provenance() -> dict[str, str]:
    return {
        "minisim": __version__,
        "results": str(RESULTS),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "machine": platform.machine(),
    }


def _flat(summary: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in summary.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}_")
        else:
            yield f"{prefix}{key}", value


def _shares(shares: Any, equal: str) -> str:
    return equal if shares is None else ":".join(f"{share:g}" for share in shares)
