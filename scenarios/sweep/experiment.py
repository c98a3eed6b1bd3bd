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
from types import FunctionType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from minisim.control import Controller
from minisim.errors import InputError, MinisimError, choice, instance, integer, show
from minisim.hosting import ON_COLLISION
from minisim.junction.geometry import ARM_NAMES
from minisim.results.metrics import Metric, named_metrics, recording
from minisim.results.trips import Trips
from minisim.version import __version__
from scenarios.scenario import Scenario
from scenarios.statistics import growing

if TYPE_CHECKING:
    import pandas as pd

#: Raised by one whenever the same experiment gives another row than before, while the version of
#: the package stays: rows of older results are then computed again.
RESULTS = 3

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
        metrics: what its row has besides the usual (`minisim.results.metrics`).
    """

    scenario: Scenario
    controller: Controller
    seed: int = 0
    label: str = ""
    on_collision: str = "stop"
    metrics: tuple[str | Metric, ...] = ()

    def __post_init__(self) -> None:
        instance("scenario", self.scenario, Scenario)
        if isinstance(self.controller, type) or not isinstance(self.controller, Controller):
            missing = [part for part in ("name", "start") if not hasattr(self.controller, part)]
            lack = f", which has no {' and no '.join(missing)}" if missing else ", which is a class"
            raise InputError(f"controller must be a Controller, got {show(self.controller)}{lack}")
        integer("seed", self.seed, low=0)
        instance("label", self.label, str)
        choice("on_collision", self.on_collision, ON_COLLISION)
        object.__setattr__(self, "metrics", named_metrics(self.metrics))

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
            "warmup_s": scenario.warmup,
        }


def key_of(description: str) -> str:
    """SHA-256 of a description."""
    return hashlib.sha256(description.encode()).hexdigest()


def canonical(value: object) -> Any:
    """The parameters of a recipe as JSON values, alike for equal recipes.

    Dataclasses become their class and fields, functions their name and what they enclose, and both
    what tells versions of their code apart (`_code`). Numbers become floats (350 and 350.0 are the
    same density), arrays their type, shape and SHA-256.

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
    if inspect.isfunction(value):
        return {
            "function": f"{value.__module__}.{value.__qualname__}",
            "line": value.__code__.co_firstlineno,  # tells two lambdas apart
            "defaults": canonical([value.__defaults__, value.__kwdefaults__]),
            "encloses": canonical([cell.cell_contents for cell in value.__closure__ or ()]),
            **_code(value),
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
        "functions, arrays and collections of them"
    )


@cache
def _code(kind: type | FunctionType) -> dict[str, Any]:
    """What tells versions of a class or function apart: its `version`, or the text of its modules.

    Nothing for our own classes, whose rows have the version of the results. A recipe's rules are
    in its session as a rule, so the whole file counts; what that imports does not.

    Raises:
        InputError: no version, and no file, as in an interactive session.
    """
    modules = sorted({
        parent.__module__
        for parent in (kind.__mro__ if isinstance(kind, type) else (kind,))
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
            "one could be told: give it a text or an integer `version`"
        ) from error
    return {"code": hashlib.sha256(texts.encode()).hexdigest()}


def _canonical_number(value: Real | Integral) -> float | str:
    number = float(value)
    return number + 0.0 if number == value or math.isnan(number) else str(value)


def run_experiment(experiment: Experiment) -> Outcome:
    """Run one experiment; a `MinisimError` becomes part of the row."""
    from minisim.simulation import simulate

    began = time.thread_time()
    try:
        run = simulate(
            experiment.scenario,
            experiment.controller,
            experiment.seed,
            record=recording(experiment.metrics),
            on_collision=experiment.on_collision,
        )
        cpu = time.thread_time() - began
        summary = dict(_flat(run.summary(("queue_growth", *experiment.metrics))))
    except MinisimError as error:
        return failed(experiment, error)
    identity = experiment.identity()
    row = {
        **(identity | summary | identity),  # columns in this order, the name from the label
        "growing": grows(summary, experiment.scenario.intersection.n),
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


def grows(row: Mapping[str, Any] | pd.Series[Any], arms: int) -> bool:
    """Whether the queues of the junction or of a lane kept growing.

    Args:
        row: of a run, or the sums over several.
        arms: of the junction.
    """
    return any(
        growing(float(row[f"{of}queue_growth"]), int(row[f"{of}trips"]))
        for of in ("", *(f"lanes_{lane}_" for lane in ARM_NAMES[:arms]))
    )


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


def _shares(shares: tuple[float, ...] | None, equal: str) -> str:
    return equal if shares is None else ":".join(f"{share:g}" for share in shares)
