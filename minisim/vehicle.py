"""Vehicle types, which are sizes and car-following parameters, and the car-following models."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from minisim.errors import InputError, number
from minisim.parameters import Switch, declared, real, switch, text, word

#: SUMO's `POSITION_EPS` [m].
POSITION_EPS = 0.1


class Model(NamedTuple):
    """A car-following model: `minisim.carfollowing` has its equations, `minisim.laws` its use."""

    meaning: str
    #: How hard a vehicle brakes for a stationary obstacle [m/s²], given its acceleration and
    #: comfortable deceleration.
    braking: Callable[[float, float], float]
    #: Whether it gives the next speed, at which a vehicle drives the whole step
    #: (`minisim.carfollowing.semi_implicit`); otherwise the step is ballistic.
    stepwise: bool = False
    sumo: str = ""  # SUMO's model of the same law; empty if it has none
    stand_ins: tuple[str, ...] = ("Krauss",)  # SUMO's models of other laws for such vehicles


def _idm_braking(a: float, b: float) -> float:
    """How hard the IDM brakes, plus a quarter [m/s²].

    It brakes at k²/b minus its free-road term, at most a; k = v²/2s is just enough. So
    k²/b − a = k at k = (b + √(b² + 4ab))/2.
    """
    return 1.25 * (b + math.sqrt(b * b + 4.0 * a * b)) / 2.0


#: Every car-following model by name. Their order gives their numbers in the kernel.
MODELS: Mapping[str, Model] = {
    "idm": Model("the IDM", _idm_braking, sumo="IDM"),
    "iidm": Model("the improved IDM, which keeps the gap s0 + vT at any speed", _idm_braking),
    # Its safe speed leaves room for braking at b, so it never brakes harder.
    "krauss": Model(
        "SUMO's default law without its random part", lambda _, b: b, stepwise=True, sumo="Krauss"
    ),
    # A cruise control brakes as hard as the vehicle can.
    "cc": Model(
        "cruise control, only for a `CruiseVehicle`",
        lambda *_: 0.0, stepwise=True, sumo="CC", stand_ins=(),
    ),
}  # fmt: skip


@declared(kw_only=True)
class VehicleType:
    """Size and car-following parameters of a kind of vehicle (SI units).

    The defaults are SUMO's passenger car (`vType` defaults of vClass "passenger": length 5,
    width 1.8, minGap 2.5, accel 2.6, decel 4.5, tau 1.0, emergencyDecel 9), for runs comparable
    with SUMO's. The exponent is from Treiber, Hennecke, Helbing 2000 (PRE 62:1805).

    The headway has a lower bound: no law reacts faster than the longest step allows (Treiber,
    Kanagaraj 2015 on dt and T). The brakes must do what the law itself asks (`needed_braking`).
    Except under cruise control, a vehicle also brakes for a leader that it could not stop behind,
    as hard as it can if it must (`minisim.laws.keep_room`).
    """

    length: float = real(
        "bumper to bumper", "m", default=5.0, low=0.5, high=30, label="vehicle length"
    )
    width: float = real("of the body", "m", default=1.8, low=0.3, high=4, label="vehicle width")
    rear_axle: float | None = real(
        "from the front bumper to the rear axle, which is dragged through turns (a bicycle model); "
        "none means that the rear bumper follows the path, as in SUMO",
        "m", default=None, above=0, high=30, optional=True,
    )  # fmt: skip
    acceleration: float = real(
        "the IDM's a, Krauß's acceleration", "m/s²", default=2.6, above=0, high=100
    )
    deceleration: float = real(
        "comfortable braking, the IDM's b; Krauß's law never brakes harder and expects the same of "
        "leaders",
        "m/s²", default=4.5, above=0, high=1000,
    )  # fmt: skip
    headway: float = real("time headway T", "s", default=1.0, low=0.5, high=10)
    min_gap: float = real("bumper gap at standstill s0", "m", default=2.5, low=0.5, high=20)
    exponent: float = real("free-road δ; Krauß's law has none", default=4.0, low=1, high=50)
    max_deceleration: float = real("of the brakes", "m/s²", default=9.0, low=0, high=1000)
    # SUMO's speedFactor is cut to the same range.
    speed_deviation: float = real(
        "standard deviation of each driver's factor on the speed limit (mean 1, cut to 0.2 … 2); "
        "0 makes all drivers alike",
        default=0.0, low=0, high=0.5,
    )  # fmt: skip
    sumo: str | None = word(
        "the version of SUMO whose vehicles it drives like, from insertion to arrival, at stop "
        "lines and inside the junction; only with krauss; none means minisim's own rules",
        ("1.18",), optional=True, default=None, label="SUMO version of a vehicle",
    )  # fmt: skip
    name: str = text(
        "what tables, arrival tables and figures call it",
        default="car",
        label="vehicle type's name",
    )
    model: str = word(
        f"car following: {'; '.join(f'{name}, {it.meaning}' for name, it in MODELS.items())}",
        tuple(MODELS), default="idm", label="car-following model",
    )  # fmt: skip

    def __post_init__(self) -> None:
        if self.model == "cc" and not isinstance(self, CruiseVehicle):
            raise InputError("the car-following model 'cc' needs a CruiseVehicle")
        if self.sumo is not None and self.model not in ("krauss", "cc"):
            raise InputError(
                f"sumo={self.sumo!r} needs the car-following model 'krauss', not {self.model!r}"
            )
        if self.rear_axle is not None:
            number("rear_axle [m]", self.rear_axle, above=0, high=self.length)
            if self.sumo is not None:
                raise InputError("a vehicle with SUMO's rules (sumo=…) has no rear_axle")
        if self.max_deceleration < self.needed_braking:
            raise InputError(
                f"max_deceleration must be at least {self.needed_braking:.2f} m/s², got "
                f"{self.max_deceleration!r}: with acceleration {self.acceleration:g} and "
                f"deceleration {self.deceleration:g} the car-following law itself brakes that hard"
            )

    @property
    def types(self) -> tuple[VehicleType, ...]:
        """Itself, as the types of a `minisim.fleet.Fleet` that has only one."""
        return (self,)

    @property
    def needed_braking(self) -> float:
        """How hard the model makes a vehicle brake for a stationary obstacle [m/s²]."""
        return MODELS[self.model].braking(self.acceleration, self.deceleration)

    @property
    def margin(self) -> float:
        """It is inserted this far past its length, and arrives this far before the end [m].

        SUMO does so where vehicles depart at "base", as in the published runs.
        """
        return 0.0 if self.sumo is None else POSITION_EPS

    @property
    def looks_out(self) -> bool:
        """Whether it lets vehicles pass that cross its way inside the junction."""
        return self.sumo == "1.18"

    def top_speed(self, limit: float) -> float:
        """Upper bound on this type's speed on a road with the speed limit `limit` [m/s]."""
        return 2.0 * limit


@declared(kw_only=True)
class CruiseVehicle(VehicleType):
    """A vehicle under cruise control with an engine that lags: SUMO's car-following model `CC`.

    It drives at `cruise_speed`, whatever the speed limit, until a controller advises another speed.
    Equations: `minisim.carfollowing.cruise_control`, `distance_control`, `engine_lag`. It keeps no
    distance to stop in (SUMO's speed mode 0), so vehicles may collide as in SUMO. The defaults are
    those of SUMO's model (`MSCFModel_CC`, from Plexe) unless the authors' vehicle type overrides
    them; headway and spacing are the ACC's.
    """

    cruise_speed: float = real(
        "desired speed until advised otherwise (SUMO's ccDesiredSpeed)", "m/s",
        default=14.0, low=0, high=100,
    )  # fmt: skip
    cruise_gain: float = real("of the control (ccKp)", "1/s", default=1.0, above=0, high=100)
    cruise_acceleration: float = real(
        "its largest acceleration (ccAccel)", "m/s²", default=1.5, above=0, high=100
    )
    cruise_deceleration: float = real(
        "its strongest braking (ccDecel)", "m/s²", default=1.5, above=0, high=100
    )
    spacing_gain: float = real(
        "the ACC's gain on the spacing error (lambda)", "1/s", default=0.1, above=0, high=100
    )
    spacing: float = real(
        "what the ACC keeps beyond headway and min_gap, fixed in SUMO's code", "m",
        default=2.0, low=0, high=100,
    )  # fmt: skip
    lag: float = real("time constant of the engine (tauEngine)", "s", default=0.5, low=0, high=10)
    engine_acceleration: float = real(
        "the most that the engine can do (accel)", "m/s²", default=50.0, above=0, high=1000
    )
    radar: float = real(
        "how far it sees the vehicle ahead, fixed in SUMO's code", "m",
        default=250.0, above=0, high=10_000,
    )  # fmt: skip
    headway: float = real("the ACC's time headway", "s", default=1.5, low=0.5, high=10)
    max_speed: float = real(
        "upper bound before and inside the junction (maxSpeed)", "m/s",
        default=55.55, above=0, high=100,
    )  # fmt: skip
    obeys: Switch = switch(
        "whether it keeps to limits and lights by itself, but late: it brakes once it is in a "
        "turn, runs amber and stops dead at red (SUMO's speed mode 31; false is 0)", default=False,
    )  # fmt: skip
    sumo: str = word(
        "the version of SUMO whose radar it has; 1.18, of the published runs, sees more",
        ("1.18", "1.28"), default="1.18", label="SUMO version of a CruiseVehicle",
    )  # fmt: skip
    model: str = word(
        MODELS["cc"].meaning, ("cc",), default="cc", label="car-following model of a CruiseVehicle"
    )

    def top_speed(self, limit: float) -> float:
        """The same bound, or the cruise speed if that is higher."""
        return max(super().top_speed(limit), self.cruise_speed)
