"""The road markings of DIM: where vehicles slow down, decide, and wait."""

from __future__ import annotations

from functools import lru_cache

from minisim.control import COMMIT_MARGIN, Marking, Site, stopping_distance
from minisim.errors import InputError
from minisim.laws import STOP_LINE_GAP
from minisim.parameters import declared, real

KMH = 1.0 / 3.6


@declared
class Zones:
    """The red, yellow and green zones, in this order towards the junction (from the paper).

    A vehicle slows down in the red zone. From the start of the yellow zone it takes part in
    decisions. It waits for its right of way at the hold line, where the yellow zone ends. In the
    green zone, a vehicle that loses its right of way can still stop.
    """

    red: float = real("length", "m", default=30.0, low=0, high=1000, label="red zone")
    # A held vehicle stops up to 0.3 m before its hold line (`minisim.laws.STOP_MARGIN`), and would
    # never take part if it did not stand in the yellow zone then.
    yellow: float = real("length", "m", default=6.0, low=0.5, high=1000, label="yellow zone")
    # A vehicle that brakes for the hold line must never look unable to stop: others would wait.
    green: float = real(
        "length", "m", default=2.0, low=COMMIT_MARGIN, high=1000, label="green zone"
    )
    red_speed: float = real(
        "speed to which vehicles slow in the red zone; it holds up to the junction", "m/s",
        default=20.0 * KMH, above=0, high=100,
    )  # fmt: skip

    @property
    def yellow_start(self) -> float:
        """Distance before the junction from which a vehicle takes part in decisions [m]."""
        return self.green + self.yellow

    @property
    def red_start(self) -> float:
        """Distance before the junction at which the zones begin [m]."""
        return self.green + self.yellow + self.red

    def markings(self, site: Site) -> tuple[Marking, ...]:
        """The markings of every approach lane, from the far end to the junction.

        In the paper a vehicle enters the red zone and *then* slows down, but a host slows it down
        before a limit begins. So the limit begins where a vehicle that brakes comfortably from the
        start of the red zone has slowed to it: after (v² − v_red²) / 2b, 23.1 m for the paper's 40
        to 20 km/h at 2 m/s². In a red zone that is too short for this, the limit begins with the
        yellow zone, and vehicles begin to brake before the red zone.
        """
        return _markings(self, site.vehicle.deceleration, site.speed_limit)

    def _stretches(self, b: float, limit: float) -> tuple[Marking, ...]:
        braking = stopping_distance(limit, b) - stopping_distance(self.red_speed, b)
        slowed = min(max(self.red_start - braking, self.yellow_start), self.red_start)
        stretches = (
            ("red", self.red_start, slowed, None),
            ("red", slowed, self.yellow_start, self.red_speed),
            ("yellow", self.yellow_start, self.green, self.red_speed),
            ("green", self.green, 0.0, self.red_speed),
        )
        return tuple(Marking(*stretch) for stretch in stretches if stretch[1] > stretch[2])

    def check(self, site: Site) -> None:
        """Raise `InputError` if vehicles could be inserted past the start, or stop before it."""
        it = site.vehicle
        if it.sumo is not None and it.model == "krauss" and self.yellow <= STOP_LINE_GAP:
            raise InputError(
                f"yellow zone [m] must be more than {STOP_LINE_GAP:g} with SUMO's vehicles, which "
                f"stop that far before a line, got {self.yellow:g}"
            )
        junction = site.intersection
        room = junction.shortest_approach - site.vehicle.length
        if self.red_start > room:
            needed = self.red_start + site.vehicle.length + junction.junction_radius
            told = junction.too_short(f"at least {needed:g}")
            raise InputError(
                f"the zones are {self.red_start:g} m long, but an approach lane leaves only "
                f"{room:.4g} m in front of an inserted vehicle; {told}"
            )


@lru_cache(maxsize=64)
def _markings(zones: Zones, deceleration: float, limit: float) -> tuple[Marking, ...]:
    return zones._stretches(deceleration, limit)
