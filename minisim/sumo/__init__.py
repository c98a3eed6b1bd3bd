"""SUMO as a second host of the same controllers (extra `sumo`).

    from minisim.sumo import simulate

    run = simulate(four_way(density=350), Dim(), seed=1)  # a Run, as minisim.simulate returns

This package is the only one that runs SUMO. `minisim.town` reads the format of its networks.
"""

from __future__ import annotations

from minisim.sumo.prepare import MODELS
from minisim.sumo.simulation import Simulation, simulate

__all__ = ["MODELS", "Simulation", "simulate"]
