"""A linear policy for the right of way, and the controller that it makes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from minisim.control import NOTHING, Command, Plan, Site, View
from minisim.errors import InputError
from minisim.junction.movements import movements_of
from minisim.names import Name
from minisim.parameters import Reals, declared, real, reals
from scenarios.environments.passing import Passing
from scenarios.environments.right_of_way import observed

Floats = npt.NDArray[np.float64]


def size(arms: int) -> int:
    """How many weights a policy has: one for each number of an observation, and a constant."""
    return 2 * len(movements_of(arms)) + 5 * arms + 1


def wishes(
    weights: npt.ArrayLike, seen: npt.ArrayLike, conflicts: npt.NDArray[np.bool_]
) -> npt.NDArray[np.int8]:
    """Which movements shall go: those of the lanes with the largest w·x, as long as it is above 0.

    x is the observation as seen from the lane, its own part first and then clockwise, and a 1 at
    the end; so one set of weights serves all lanes. One lane after the other is chosen, if the
    vehicle that asks on it conflicts neither with a settled one nor with those chosen before.

    Args:
        weights: shape (k, size(arms)).
        seen: observations of `RightOfWayEnv`, shape (k, size(arms) − 1).
        conflicts: of the movements, shape (m, m).

    Returns:
        Actions of `RightOfWayEnv`, shape (k, m).
    """
    w, x = np.asarray(weights, np.float64), np.asarray(seen, np.float64)
    m = len(conflicts)
    arms = round((1.0 + math.sqrt(1.0 + 4.0 * m)) / 2.0)
    own = x[:, : x.shape[1] - m].reshape(len(x), arms, -1)
    score = (x[:, _turned(arms)] @ w[:, :-1, None])[..., 0] + w[:, -1:]
    score[own[:, :, 0] == 0.0] = -np.inf
    wanted = own[:, :, 4:-1].argmax(axis=2) + 1
    movement = movements_of(arms).index_of[np.arange(arms), wanted]
    taken = x[:, -m:] > 0.0
    chosen = np.zeros((len(x), m), np.int8)
    each = np.arange(len(x))
    for lane in np.argsort(-score, axis=1, kind="stable").T:
        p = movement[each, lane]
        goes = (score[each, lane] > 0.0) & ~(conflicts[p] & taken).any(axis=1)
        chosen[each[goes], p[goes]] = 1
        taken[each[goes], p[goes]] = True
    return chosen


@lru_cache
def _turned(arms: int) -> npt.NDArray[np.int64]:
    """For each lane, the places in an observation in the order in which it looks at them."""
    width, turns = arms + 4, arms - 1
    own = np.arange(arms * width).reshape(arms, width)
    settled = arms * width + np.arange(arms * turns).reshape(arms, turns)
    return np.array([
        np.concatenate([np.roll(it, -lane, axis=0).ravel() for it in (own, settled)])
        for lane in range(arms)
    ])  # fmt: skip


@declared
class Learnt:
    """Gives the right of way as a linear policy wishes, as far as that is safe.

    It decides as often, sees as far and is masked as `RightOfWayEnv` is. No two vehicles collide;
    that each is served is not promised, since the policy may never wish it.
    """

    name = Name("learnt")
    covers = NOTHING

    weights: Reals[tuple[float, ...]] = reals("of the policy, as `wishes` takes them")
    interval: float = real("between two decisions", "s", default=1.0, low=0.01, high=60)
    sight: float = real(
        "how far before the junction a vehicle may get the right of way", "m",
        default=50.0, above=0, high=1000,
    )  # fmt: skip

    def start(self, site: Site) -> LearntSession:
        """Begin a run; raises `InputError` if the weights are for another number of arms."""
        n = site.intersection.n
        if len(self.weights) != size(n):
            got = len(self.weights)
            raise InputError(f"learnt needs {size(n)} weights for {n} arms, got {got}")
        return LearntSession(self, site)


class LearntSession:
    """One run of a linear policy."""

    def __init__(self, learnt: Learnt, site: Site) -> None:
        self._learnt, self._site = learnt, site
        self._weights = np.array([learnt.weights])
        self._passing = Passing(site, learnt.sight, masked=True)
        road = site.intersection.approach_length
        self.plan = Plan(period=site.period("interval", learnt.interval), sight=road)

    def decide(self, view: View) -> Sequence[Command]:
        """Look, wish, and give the right of way as far as that is safe."""
        site, passing = self._site, self._passing
        junction = passing.look(view)
        seen = observed(view, junction, site, self._learnt.sight)
        wished: Any = wishes(self._weights, seen[None], site.conflicts)[0]
        return passing.commands(junction, lambda v: bool(wished[passing.movement(v)]))
