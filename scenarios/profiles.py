"""Profiles: consistent sets of vehicle, speeds and step, such as `paper` and `fair`."""

from __future__ import annotations

from minisim.errors import choice, number
from minisim.parameters import declared, part, real, text
from minisim.vehicle import CruiseVehicle, VehicleType

KMH = 1.0 / 3.6


@declared(kw_only=True)
class Profile:
    """One consistent set of vehicle, speeds and step."""

    name: str = text("its name on the command line", label="profile name")
    vehicle: VehicleType = part("the type of all vehicles", VehicleType)
    speed_limit: float = real("of the roads", "m/s", above=0, high=100)
    depart_speed: float | None = real(
        "at insertion; None is the highest safe speed up to the limit", "m/s",
        low=0, optional=True, default=None,
    )  # fmt: skip
    dt: float = real("step", "s", low=0.001, high=0.5, default=0.1)

    def __post_init__(self) -> None:
        if self.depart_speed is not None:
            number("depart_speed [m/s]", self.depart_speed, high=self.speed_limit)


#: What the paper's text prescribes in §III: roads of 40 km/h, deceleration 2 m/s², cars of 4 m with
#: 2 m of headway. The rest (acceleration, time headway, emergency braking, width) is taken from
#: SUMO's passenger car, since the paper simulates in SUMO.
PAPER = Profile(
    name="paper",
    vehicle=VehicleType(length=4.0, min_gap=2.0, deceleration=2.0),
    speed_limit=40.0 * KMH,
)

#: One vehicle, speed limit and departure speed for every controller: SUMO's passenger car on the
#: 14 m/s roads of the authors' network.
FAIR = Profile(name="fair", vehicle=VehicleType(), speed_limit=14.0)

#: How the published numbers arose: SUMO's `CC` vehicle as the authors' route file defines it
#: (length 4, minGap 2, accel 50, decel 1000, tauEngine 0.5, ccAccel 4; its `ccDccel` is misspelt,
#: so SUMO's default of 1.5 applies), headway 1.5 s, inserted at rest, speed limits ignored, step
#: 0.01 s. `deceleration` is the strongest braking that the cruise control itself asks for.
#: Controllers and hold lines use it; the authors' DIM has no hold lines.
AS_RUN = Profile(
    name="as_run",
    vehicle=CruiseVehicle(
        length=4.0,
        min_gap=2.0,
        acceleration=4.0,
        deceleration=1.5,
        max_deceleration=1000.0,
        cruise_acceleration=4.0,
    ),
    speed_limit=14.0,
    depart_speed=0.0,
    dt=0.01,
)

#: How the published numbers arose for both signals at balanced inflow, and for the adaptive signal
#: also at 4:1:4:1. The vehicle follows SUMO's Krauss model without its random part, tau 1
#: (`carFollowModel` is not given), accel 50, decel 1000, length 4, minGap 2. Speed factors are
#: N(1, 0.1), SUMO's default (0.80 … 1.24 in the published trips). Vehicles are inserted at rest on
#: roads of 14 m/s. The runs had a step of 0.01 s; a step of 0.1 s gives the same waiting time
#: within 1 % and the same travel time within 0.15 s (fixed-time signal, 150 … 350 veh/h, common
#: seeds).
AS_RUN_SIGNALS = Profile(
    name="as_run_signals",
    vehicle=VehicleType(
        length=4.0,
        min_gap=2.0,
        acceleration=50.0,
        deceleration=1000.0,
        max_deceleration=1000.0,
        speed_deviation=0.1,
        model="krauss",
    ),
    speed_limit=14.0,
    depart_speed=0.0,
)

#: The profiles of the published runs; they use the junctions in the authors' networks.
PUBLISHED_PROFILES = (AS_RUN, AS_RUN_SIGNALS)

PROFILES: dict[str, Profile] = {p.name: p for p in (PAPER, FAIR, *PUBLISHED_PROFILES)}


def profile_named(name: str | Profile) -> Profile:
    """The profile with this name; a `Profile` is returned as it is."""
    if isinstance(name, Profile):
        return name
    return PROFILES[choice("profile", name, PROFILES)]
