"""Fuel and carbon dioxide by speed and acceleration: SUMO's model based on HBEFA 3.1.

Source: Krajzewicz, Behrisch, Wagner, Luz, Krumnow, Second Generation of Pollutant Emission Models
for SUMO, Lecture Notes in Mobility (2015), 203–221. A class of vehicles emits per time
(c₀ + c₁av + c₂v + c₃v² + c₄v³)/3.6 mg/s with v in m/s and a in m/s², never less than nothing, and
nothing while it coasts (`coasting`). The coefficients [g/h] were fitted to the rates that
`emissionsDrivingCycle` of SUMO 1.28 prints; the fit repeats them to all six digits.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from minisim.fleet import kind_of
from minisim.results.trips import Floats

Coefficients = tuple[float, float, float, float, float]


class Emission(NamedTuple):
    """The coefficients of a class [g/h], with v in m/s and a in m/s²."""

    fuel: Coefficients
    co2: Coefficients


#: Classes of HBEFA3 in SUMO: cars and light vehicles with petrol engines of the norm Euro 4, and
#: the averages of buses and of heavy vehicles.
CLASSES: Final = {
    "PC_G_EU4": Emission((3014, 299.3, -149, 9.014, 0), (9449, 938.4, -467.1, 28.26, 0)),
    "LDV_G_EU4": Emission((1613, 323.8, 91.39, 0, 0.1012), (5056, 1015, 286.5, 0, 0.3172)),
    "Bus": Emission((6016, 2049, 656.6, 0, 0), (19030, 6475, 2073, 0, 0)),
    "HDV": Emission((8358, 2226, 551.4, 0, 0), (26570, 7076, 1753, 0, 0)),
}

#: Kind of vehicle (`minisim.fleet.kind_of`) -> its class. Those left out have none in HBEFA3.
OF_KIND: Final = {"car": "PC_G_EU4", "lcv": "LDV_G_EU4", "bus": "Bus", "truck": "HDV"}

#: A vehicle this slow idles [m/s]; `coasting` grows in proportion up to the second speed.
IDLING, ROLLING = 0.5, 10.0 / 3.6


def emission_class(name: str) -> str | None:
    """The class of a ready type of vehicles, or of one that is named like it."""
    return OF_KIND.get(kind_of(name))


def coasting(v: Floats) -> Floats:
    """Deceleration by rolling and drag alone [m/s²], at which the engine of a car burns nothing.

    Measured with `emissionsDrivingCycle` (SUMO 1.28; its page Models/Emissions, "Coasting
    vehicles"): linear in the speed, the same for all classes.
    """
    return (0.107948 + 0.0129766 * np.maximum(v, ROLLING)) * np.minimum(v / ROLLING, 1.0)


def rate(v: Floats, a: Floats, coefficients: Coefficients) -> Floats:
    """What a vehicle emits [mg/s], by its speed [m/s] and acceleration [m/s²], arrays alike."""
    c0, c1, c2, c3, c4 = coefficients
    emitted = np.maximum(c0 + v * (c1 * a + c2 + v * (c3 + v * c4)), 0.0) / 3.6
    return np.where((v > IDLING) & (a < -coasting(v)), 0.0, emitted)
