"""Vehicle types: size and car-following parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass

from minisim.errors import InputError, choice, number

MODELS = ("idm", "iidm")


@dataclass(frozen=True, kw_only=True)
class VehicleType:
    """Size and car-following parameters of a kind of vehicle (SI units).

    The defaults are SUMO's passenger car (`vType` defaults of vClass "passenger": length 5,
    width 1.8, minGap 2.5, accel 2.6, decel 4.5, tau 1.0, emergencyDecel 9), so that runs
    compare with SUMO. The exponent is Treiber, Hennecke, Helbing 2000 (PRE 62:1805).

    Attributes:
        length: bumper to bumper [m].
        width: [m].
        acceleration: the IDM's a [m/s²].
        deceleration: comfortable braking, the IDM's b [m/s²].
        headway: time headway T [s]; at least 0.5, the longest step there is: below it the law
            cannot react in time (Treiber, Kanagaraj 2015 on dt and T).
        min_gap: bumper gap at standstill s0 [m]; at least 0.5.
        exponent: free-road exponent δ.
        max_deceleration: what the brakes can do at most [m/s²]; at least `needed_braking`. Even
            so weak brakes at high speed can be too weak for a leader that stops: the law then
            collides, and the run reports it.
        speed_deviation: standard deviation of each driver's factor on the speed limit (mean 1,
            cut to 0.2 … 2 as SUMO's speedFactor); 0 makes all drivers alike.
        model: "idm", or "iidm" (improved IDM: keeps the gap s0 + vT up to the desired speed).
    """

    length: float = 5.0
    width: float = 1.8
    acceleration: float = 2.6
    deceleration: float = 4.5
    headway: float = 1.0
    min_gap: float = 2.5
    exponent: float = 4.0
    max_deceleration: float = 9.0
    speed_deviation: float = 0.0
    model: str = "idm"

    def __post_init__(self) -> None:
        number("vehicle length [m]", self.length, low=0.5, high=30)
        number("vehicle width [m]", self.width, low=0.3, high=4)
        number("acceleration [m/s²]", self.acceleration, above=0, high=100)
        number("deceleration [m/s²]", self.deceleration, above=0, high=100)
        number("headway [s]", self.headway, low=0.5, high=10)
        number("min_gap [m]", self.min_gap, low=0.5, high=20)
        number("exponent", self.exponent, low=1, high=50)
        number("max_deceleration [m/s²]", self.max_deceleration, low=0, high=1000)
        if self.max_deceleration < self.needed_braking:
            raise InputError(
                f"max_deceleration must be at least {self.needed_braking:.2f} m/s², got "
                f"{self.max_deceleration!r}: with acceleration {self.acceleration:g} and "
                f"deceleration {self.deceleration:g} the car-following law itself brakes that hard"
            )
        number("speed_deviation", self.speed_deviation, low=0, high=0.5)
        choice("car-following model", self.model, MODELS)

    @property
    def needed_braking(self) -> float:
        """What the law asks of the brakes in front of a standing obstacle, and a quarter more.

        The IDM brakes at k²/b where k = v²/2s is just enough, and its free-road term takes up to
        a away again: k²/b − a = k at k = (b + √(b² + 4ab))/2 [m/s²].
        """
        a, b = self.acceleration, self.deceleration
        return 1.25 * (b + math.sqrt(b * b + 4.0 * a * b)) / 2.0
