"""Named random streams: one `SeedSequence` a run, one child for each purpose.

Whoever draws from one stream cannot shift another: the arrivals of a seed are the same for
every controller (common random numbers), whatever the controller draws.
"""

from __future__ import annotations

import numpy as np

from minisim.errors import choice, integer

#: Order matters: it is the spawn key. Append only.
STREAMS = ("arrivals", "manoeuvres", "perception", "drivers", "humans")


def stream(seed: int, name: str) -> np.random.Generator:
    """The random stream `name` of the run with this `seed`."""
    integer("seed", seed, low=0)
    key = STREAMS.index(choice("random stream", name, STREAMS))
    return np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=(key,)))
