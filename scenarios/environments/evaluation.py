"""How good a trained policy is, beside others, on arrivals that it has never seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd

from minisim.control import Controller
from scenarios.controllers import controller_named
from scenarios.environments.linear import Learnt
from scenarios.environments.training import begin
from scenarios.library import four_way
from scenarios.optimum import ABOVE, DELAY, LEAST, Clairvoyant, drained
from scenarios.recipe import Recipe
from scenarios.sweep.runner import Progress, sweep

#: Demands of the comparison [veh/h/lane]; the policy is trained at the highest one.
DENSITIES = (250.0, 350.0, 450.0)
#: Seeds of the comparison. Training draws its own from 2³¹ values, and none of these counts there.
SEEDS = 10
#: Those that the policy is compared with, and what it began with.
RIVALS = ("dim", "dim:gate=harmonious", "max-pressure", "reservation")
LEARNT, START = "learnt", "longest wait first"


def compared(
    weights: Sequence[float],
    *,
    densities: Sequence[float] = DENSITIES,
    seeds: int = SEEDS,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> pd.DataFrame:
    """Rows of `sweep` with the delay of each controller, the least possible one, and the excess.

    Vehicles of the profile fair come on four arms for half an hour, and all arrive.
    """
    recipes = []
    for density in densities:
        scenario = drained(four_way(density, profile="fair", horizon=1800.0))
        named: Mapping[str, Controller] = {
            LEARNT: Learnt(tuple(weights)),
            START: Learnt(tuple(begin(4))),
            **{name: controller_named(name, scenario.profile) for name in RIVALS},
            Clairvoyant.name: Clairvoyant(scenario),
        }
        recipes += [
            Recipe(scenario, controller, seed, label=label, metrics=(DELAY, LEAST, ABOVE))
            for label, controller in named.items() for seed in range(seeds)
        ]  # fmt: skip
    return sweep(recipes, progress=progress, jobs=jobs)
