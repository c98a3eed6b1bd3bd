"""Named random streams: one `SeedSequence` per run, one child per purpose.

Draws from one stream cannot shift another, so a seed gives the same arrivals for every controller,
whatever it draws (common random numbers).
"""

from __future__ import annotations

import hashlib
import math
import struct

import numpy as np

from minisim.errors import choice, integer

#: The place of a name is its spawn key: append only.
STREAMS = ("arrivals", "manoeuvres", "perception", "drivers", "humans", "types", "messages")


def stream(seed: int, name: str) -> np.random.Generator:
    """The random stream `name` of the run with this `seed`."""
    integer("seed", seed, low=0)
    key = STREAMS.index(choice("random stream", name, STREAMS))
    return np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=(key,)))


class Draws:
    """Random numbers by purpose, the same in any order of the draws.

    A number is a keyed hash of a few integers, such as a purpose, a vehicle and a step, so an extra
    draw never shifts others. The hash is BLAKE2b (RFC 7693); its key is drawn from the stream.
    """

    def __init__(self, seed: int, name: str) -> None:
        self._key = stream(seed, name).bytes(32)

    def uniform(self, *of: int) -> float:
        """A number uniformly distributed on (0, 1), both ends excluded."""
        words = struct.pack(f"<{len(of)}q", *of)
        digest = hashlib.blake2b(words, digest_size=8, key=self._key).digest()
        return ((int.from_bytes(digest, "little") >> 12) + 0.5) * 2.0**-52

    def normal(self, *of: int) -> float:
        """A number from the standard normal distribution (Box & Muller 1958)."""
        radius = math.sqrt(-2.0 * math.log(self.uniform(*of, 0)))
        return radius * math.cos(2.0 * math.pi * self.uniform(*of, 1))
