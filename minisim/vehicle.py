"""Vehicle types: size and car-following parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass

from minisim.errors import InputError, choice, number

#: Car-following laws; their order is that of `minisim.engine.state.IDM` and its siblings.
MODELS = ("idm", "iidm", "krauss", "cc")


@dataclass(frozen=True, kw_only=True)
class VehicleType:
    """Size and car-following parameters of a kind of vehicle (SI units).

    The defaults are SUMO's passenger car (`vType` defaults of vClass "passenger": length 5,
    width 1.8, minGap 2.5, accel 2.6, decel 4.5, tau 1.0, emergencyDecel 9), so that runs
    compare with SUMO. The exponent is Treiber, Hennecke, Helbing 2000 (PRE 62:1805).

    Attributes:
        length: bumper to bumper [m].
        width: [m].
        acceleration: the IDM's a, Krauß's acceleration [m/s²].
        deceleration: comfortable braking, the IDM's b [m/s²]. Krauß's law brakes at b whenever
            it brakes for something foreseen, and takes it that leaders do.
        headway: time headway T [s]; at least 0.5, the longest step there is: below it the law
            cannot react in time (Treiber, Kanagaraj 2015 on dt and T).
        min_gap: bumper gap at standstill s0 [m]; at least 0.5.
        exponent: free-road exponent δ; Krauß's law has none.
        max_deceleration: what the brakes can do at most [m/s²]; at least `needed_braking`. Even
            so weak brakes at high speed can be too weak for a leader that stops: the law then
            collides, and the run reports it.
        speed_deviation: standard deviation of each driver's factor on the speed limit (mean 1,
            cut to 0.2 … 2 as SUMO's speedFactor); 0 makes all drivers alike.
        model: "idm", "iidm" (improved IDM: keeps the gap s0 + vT up to the desired speed) or
            "krauss" (SUMO's default law, without its random part); "cc" is an `EngineVehicle`.
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
        number("deceleration [m/s²]", self.deceleration, above=0, high=1000)
        number("headway [s]", self.headway, low=0.5, high=10)
        number("min_gap [m]", self.min_gap, low=0.5, high=20)
        number("exponent", self.exponent, low=1, high=50)
        number("max_deceleration [m/s²]", self.max_deceleration, low=0, high=1000)
        if self.model != "cc" and self.max_deceleration < self.needed_braking:
            raise InputError(
                f"max_deceleration must be at least {self.needed_braking:.2f} m/s², got "
                f"{self.max_deceleration!r}: with acceleration {self.acceleration:g} and "
                f"deceleration {self.deceleration:g} the car-following law itself brakes that hard"
            )
        number("speed_deviation", self.speed_deviation, low=0, high=0.5)
        choice("car-following model", self.model, MODELS)
        if self.model == "cc" and not isinstance(self, EngineVehicle):
            raise InputError("the car-following model 'cc' goes with an EngineVehicle")

    @property
    def needed_braking(self) -> float:
        """What the law asks of the brakes in front of a standing obstacle, and a quarter more.

        The IDM brakes at k²/b where k = v²/2s is just enough, and its free-road term takes up to
        a away again: k²/b − a = k at k = (b + √(b² + 4ab))/2 [m/s²]. Krauß's law brakes at b and
        not harder: its safe speed leaves room for that, so that is all it needs.
        """
        a, b = self.acceleration, self.deceleration
        if self.model == "krauss":
            return b
        return 1.25 * (b + math.sqrt(b * b + 4.0 * a * b)) / 2.0


@dataclass(frozen=True, kw_only=True)
class EngineVehicle(VehicleType):
    """A vehicle under cruise control with an engine that lags: SUMO's car-following model `CC`.

    It ignores speed limits: it drives at `cruise_speed` until a controller advises another
    speed. Equations: `minisim.carfollowing.cruise_control`, `distance_control`, `engine_lag`.
    The defaults are those of SUMO's model (`MSCFModel_CC`, from Plexe) where the authors' vehicle
    type does not override them; headway and spacing of the base class are the ACC's.

    Attributes:
        cruise_speed: desired speed until advised otherwise (SUMO's `ccDesiredSpeed`) [m/s].
        cruise_gain: the cruise control's gain (`ccKp`) [1/s].
        cruise_acceleration: its largest acceleration (`ccAccel`) [m/s²].
        cruise_deceleration: its strongest braking (`ccDecel`) [m/s²].
        spacing_gain: the ACC's gain on the spacing error (`lambda`) [1/s].
        spacing: what the ACC keeps beyond headway and `min_gap`, fixed in SUMO's code [m].
        lag: time constant of the engine (`tauEngine`) [s].
        engine_acceleration: the most it can do (`accel`) [m/s²].
        radar: how far it sees the vehicle ahead, fixed in SUMO's code [m].
    """

    cruise_speed: float = 14.0
    cruise_gain: float = 1.0
    cruise_acceleration: float = 1.5
    cruise_deceleration: float = 1.5
    spacing_gain: float = 0.1
    spacing: float = 2.0
    lag: float = 0.5
    engine_acceleration: float = 50.0
    radar: float = 250.0
    headway: float = 1.5
    model: str = "cc"

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("car-following model of an EngineVehicle", self.model, ("cc",))
        number("cruise_speed [m/s]", self.cruise_speed, low=0, high=100)
        number("cruise_gain [1/s]", self.cruise_gain, above=0, high=100)
        number("cruise_acceleration [m/s²]", self.cruise_acceleration, above=0, high=100)
        number("cruise_deceleration [m/s²]", self.cruise_deceleration, above=0, high=100)
        number("spacing_gain [1/s]", self.spacing_gain, above=0, high=100)
        number("spacing [m]", self.spacing, low=0, high=100)
        number("lag [s]", self.lag, low=0, high=10)
        number("engine_acceleration [m/s²]", self.engine_acceleration, above=0, high=1000)
        number("radar [m]", self.radar, above=0, high=10_000)
        number("headway [s]", self.headway, above=0, high=10)
