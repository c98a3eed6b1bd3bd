"""How `linear` policies are trained: by an evolution strategy, many junctions at once.

CMA-ES (Hansen & Ostermeier, Evolutionary Computation 9 (2001): 159–195; the package `cma`) draws a
population of weights in each generation. All get the same new arrivals, several runs each, in one
batch. It minimises the mean time that a vehicle spends on the way, up to the exit of the junction.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from minisim.errors import InputError, MissingExtraError, extra, integer, show
from minisim.files import AnyPath, read_file, write_text
from scenarios.environments.batch import RightOfWayBatch
from scenarios.environments.linear import Learnt, size, wishes
from scenarios.scenario import Scenario

#: Where the search begins: all may wish to go, and the one that has waited longest goes first.
CONSTANT, WAITED = 1.0, 1.0
#: Standard deviation of the first population; observations are from 0 to 1.
SPREAD = 0.3


class Generation(NamedTuple):
    """What one generation cost, in seconds per vehicle."""

    best: float  #: the best of its population
    middle: float  #: the median
    start: float  #: the policy with which the search began, on the same arrivals


class Training(NamedTuple):
    """The mean of the last population, and what led there."""

    weights: tuple[float, ...]
    generations: tuple[Generation, ...]

    def save(self, path: AnyPath) -> None:
        """Write both as JSON."""
        text = json.dumps({"weights": self.weights, "generations": self.generations}, indent=1)
        write_text(path, text + "\n")


def read_weights(path: AnyPath) -> tuple[float, ...]:
    """The weights of a file that `Training.save` wrote; raises `InputError` for another."""
    try:
        return Learnt(tuple(json.loads(read_file("weights", path))["weights"])).weights
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{show(str(path))} holds no weights: {error}") from error


def begin(arms: int) -> npt.NDArray[np.float64]:
    """The weights with which the search begins."""
    first = np.zeros(size(arms))
    first[3], first[-1] = WAITED, CONSTANT
    return first


def train(
    scenario: Scenario,
    *,
    generations: int = 200,
    population: int = 24,
    runs: int = 6,
    seed: int = 0,
    told: Callable[[int, int], None] = lambda _, __: None,
) -> Training:
    """Train a policy on a scenario; the same arguments give the same weights.

    Args:
        scenario: the runs of the training; their arrivals come from `seed`.
        generations, population: of the evolution strategy.
        runs: of each member of a population in each generation.
        seed: of all random numbers.
        told: called after each generation with their number so far and in all.

    Raises:
        MissingExtraError: the package `cma` is not installed.
    """
    try:
        import cma
    except ImportError as error:
        raise MissingExtraError(f"training needs cma: {extra('gym')}") from error
    integer("generations", generations, low=1)
    integer("population", population, low=4)
    integer("runs", runs, low=1)
    integer("seed", seed, low=0)
    first = begin(scenario.site(0).intersection.n)
    options = {"popsize": population, "seed": seed + 1, "verbose": -9}
    search = cma.CMAEvolutionStrategy(first, SPREAD, options)
    batch = RightOfWayBatch((population + 1) * runs, scenario)
    random, history = np.random.default_rng(seed), []
    for _ in range(generations):
        members = [*search.ask(), first]
        spent = costs(batch, np.array(members), random.integers(2**31, size=runs))
        search.tell(members[:-1], spent[:-1].tolist())
        best, middle = float(spent[:-1].min()), float(np.median(spent[:-1]))
        history.append(Generation(best, middle, float(spent[-1])))
        told(len(history), generations)
    return Training(tuple(map(float, search.mean)), tuple(history))


def costs(
    batch: RightOfWayBatch, weights: npt.NDArray[np.float64], seeds: npt.NDArray[np.int64]
) -> npt.NDArray[np.float64]:
    """Mean seconds that a vehicle spends, of each policy, on the same arrivals for all.

    `weights` has the shape (policies, numbers); `batch` has a junction for each and each seed.
    """
    each = np.repeat(weights, len(seeds), axis=0)
    seen, _ = batch.reset(seed=[int(seed) for seed in np.tile(seeds, len(weights))])
    vehicles = batch.vehicles.copy()
    total, going = np.zeros(len(each)), np.ones(len(each), bool)
    while going.any():
        seen, rewards, terminated, truncated, _ = batch.step(wishes(each, seen, batch.conflicts))
        total -= np.where(going, rewards, 0.0)
        going &= ~(terminated | truncated)
    return np.asarray((total / vehicles).reshape(len(weights), -1).mean(axis=1))


#: The weights that come with minisim: those of `minisim train`.
FILE = Path(__file__).parent / "learnt.json"
