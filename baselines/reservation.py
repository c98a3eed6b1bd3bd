"""Space-time reservation, first come first served, on pairwise conflict zones.

Source: Dresner, Stone, JAIR 31 (2008), 591–656. A vehicle asks the manager of the junction for a
passage. The manager predicts how the vehicle would drive, and grants the passage if the space it
needs is free at the time. Dresner and Stone use a grid of tiles. We use the conflict zones of the
movements (`minisim.junction.conflicts`): only pairs matter, and each pair's stretches are exact.

The protocol:
- From `reach` before the junction on, the first vehicle of a lane asks, and so does any vehicle
  directly behind a holder. Its passage is predicted by the vehicles' own law
  (`baselines.prediction`), behind those ahead in its lane and in its exit lane.
- The passage is granted if, for every other holder in conflict, one of the two has left its zone
  `buffer` seconds before the other enters its own. Holders enter a shared exit lane in the order of
  their grants, so a later grant never slows down an earlier one. The law lets a vehicle in the
  junction follow the one ahead of it into the exit lane as if both were on one arc. A passage on
  which it brakes harder than is comfortable for that vehicle is refused.
- A refused vehicle drives up to its stop line and slows down as late as is comfortable. Refused
  requests are considered again every `period`, in the order in which they were first made.

Safety does not depend on predictions far ahead: a vehicle loses a passage that it does not keep
(`baselines.passages`). Vehicles that differ or follow an unknown law are refused.
"""

from __future__ import annotations

from collections.abc import Iterator

from baselines.manager import Manager
from baselines.passages import PassageSession
from baselines.promises import passages_of
from minisim.control import AT_LINE, Command, Cover, Plan, Radio, Site, stopping_distance
from minisim.names import Name
from minisim.parameters import declared, real


@declared
class Reservation:
    """Space-time reservation, first come first served, for vehicles whose drivers are alike."""

    name = Name("reservation")
    covers = Cover(alike=True)
    radio = Radio()

    # Asking earlier lets distant vehicles reserve room that nearer ones need: at 350 veh/h/lane
    # (fair) the mean time loss is 4.1 s at 30 m, 4.7 at 60, 5.3 at 100 and 10.2 at 150.
    reach: float | None = real(
        "how far before the junction vehicles ask; none means stopping distance at the limit and "
        "a period's way: as late as possible without slowing down for a refusal", "m",
        low=1, high=1000, optional=True, default=None,
    )  # fmt: skip
    # 0.25 s on either side, as at the edge tiles of the AIM4 simulator.
    buffer: float = real(
        "time between one vehicle's leaving a conflict zone and another's entering its own", "s",
        low=0, high=10, default=0.5,
    )  # fmt: skip
    period: float = real("time between two looks", "s", low=0.01, high=10, default=0.5)

    def start(self, site: Site) -> ReservationSession:
        """Begin a run; raises `InputError` for vehicles whose motion cannot be predicted.

        A period below the host's step is refused, too.
        """
        self.covers.check(self.name, site.vehicle)
        return ReservationSession(self, site)


class ReservationSession(PassageSession):
    """One run: serves requests in the order in which they came."""

    def __init__(self, controller: Reservation, site: Site) -> None:
        reach, period, buffer = controller.reach, controller.period, controller.buffer
        if reach is None:
            braking = stopping_distance(site.speed_limit, site.vehicle.deceleration)
            # A vehicle that stands at its line must have asked.
            reach = max(braking + period * site.speed_limit, AT_LINE)
            if site.channel:  # a request and its answer take longer
                late = 2.0 * site.channel.slowest + controller.radio.interval
                reach += late * site.speed_limit
        reach = min(reach, site.intersection.approach_length)
        passages = passages_of(Manager(site, buffer), site, period, buffer)
        super().__init__(passages, Plan(marks=(reach,), sight=reach), period, site)
        self._requests: dict[int, None] = {}  # in the order of first requests

    def _grant(self) -> Iterator[Command]:
        """Consider the requests in the order in which they came."""
        passages, manager = self.passages, self.manager
        asking = [v for v in passages.seen if v not in manager.slots]
        new = dict.fromkeys(asking)
        self._requests = {v: None for v in (self._requests | new) if v in new}
        for vehicle in list(self._requests):
            slot = passages.ask(vehicle)
            if slot is not None and manager.fits(slot, last=True):
                yield passages.give(slot)
                del self._requests[vehicle]
