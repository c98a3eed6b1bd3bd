"""The road markings of DIM: where vehicles slow down, decide, and wait."""

from __future__ import annotations

from dataclasses import dataclass

from minisim.control import COMMIT_MARGIN, Marking, Site, stopping_distance
from minisim.errors import InputError, number

KMH = 1.0 / 3.6


@dataclass(frozen=True)
class Zones:
    """Red, yellow and green zone, in this order towards the junction (paper, same section).

    A vehicle slows down in the red zone; it takes part in decisions from the start of the yellow
    zone; it waits for its right of way at the hold line, the end of the yellow zone; the green
    zone is the buffer in which a vehicle that loses its right of way still stops.

    Attributes:
        red, yellow, green: lengths [m].
        red_speed: the speed to which the red zone slows [m/s]; it holds up to the junction.
    """

    red: float = 30.0
    yellow: float = 6.0
    green: float = 2.0
    red_speed: float = 20.0 * KMH

    def __post_init__(self) -> None:
        number("red zone [m]", self.red, low=0, high=1000)
        number("yellow zone [m]", self.yellow, above=0, high=1000)
        # A vehicle that brakes for the hold line must never look unable to stop before the
        # junction, or the others would wait for it.
        number("green zone [m]", self.green, low=COMMIT_MARGIN, high=1000)
        number("red_speed [m/s]", self.red_speed, above=0, high=100)

    @property
    def hold_distance(self) -> float:
        """The hold line's distance before the junction [m]."""
        return self.green

    @property
    def yellow_start(self) -> float:
        """Distance before the junction from which a vehicle takes part [m]."""
        return self.green + self.yellow

    @property
    def red_start(self) -> float:
        """Distance before the junction at which the zones begin [m]."""
        return self.green + self.yellow + self.red

    def markings(self, site: Site) -> tuple[Marking, ...]:
        """What is painted on every approach lane, from the far end to the junction.

        A vehicle of the paper enters the red zone and *then* slows down, while a host slows ahead
        of the stretch on which a limit holds. So the limit holds from where comfortable braking
        that begins at the start of the red zone has reached it: (v² − v_red²) / 2b further on,
        23.1 m for the paper's 40 to 20 km/h at 2 m/s². Up to there the red zone is painted
        without a limit. A red zone too short for that is where braking ends, not where it
        begins: the limit holds in the yellow zone in any case.
        """
        b = site.vehicle.deceleration
        braking = stopping_distance(site.speed_limit, b) - stopping_distance(self.red_speed, b)
        slowed = min(max(self.red_start - braking, self.yellow_start), self.red_start)
        stretches = (
            Marking("red", self.red_start, slowed) if self.red_start > slowed else None,
            Marking("red", slowed, self.yellow_start, self.red_speed)
            if slowed > self.yellow_start
            else None,
            Marking("yellow", self.yellow_start, self.green, self.red_speed),
            Marking("green", self.green, 0.0, self.red_speed),
        )
        return tuple(marking for marking in stretches if marking is not None)

    def check(self, site: Site) -> None:
        """Raise `InputError` where a vehicle could be inserted past the start of the zones."""
        room = site.intersection.approach_length - site.vehicle.length
        if self.red_start > room:
            raise InputError(
                f"the zones are {self.red_start:g} m long, but the approach lanes leave "
                f"{room:.4g} m in front of an inserted vehicle; make arm_length longer"
            )
