"""The adaptive signal: a phase lasts while delayed vehicles can still make use of it.

The rule of SUMO's traffic light type `delay_based` (`MSDelayBasedTrafficLightLogic`; its
documentation cites Oertel & Wagner, TRB 2011).
"""

from __future__ import annotations

from dataclasses import dataclass

from baselines.signals.heads import full_order, lane_order
from baselines.signals.phases import PhaseSession, Verdict, check_greens, following, on_detector
from minisim.control import Observed, Site, View
from minisim.errors import instance, number

#: An idle signal looks again after so long [s]; fixed in SUMO's code.
IDLE = 1.0


@dataclass(frozen=True)
class Adaptive:
    """A signal that prolongs a green for vehicles that have lost time before the junction.

    One phase an approach, in a fixed order; none is left out. A vehicle that has lost more
    than `min_time_loss` on the last `detector_range` metres prolongs its lane's green by the time
    it takes to the stop line at the speed limit, if that is before `max_green`. While nobody is on
    the other lanes, a green goes on too.

    The time of a phase runs from the green that is really shown: a head waits until nobody crosses
    its way. Time lost is that against the speed limit, whatever a driver would like.

    Attributes:
        detector_range: [m]; SUMO's default.
        min_time_loss: [s]; SUMO's default.
        min_green: [s]; the authors' network (`minDur`).
        max_green: [s]; the authors' network (`maxDur`).
        extend_max_green: while nobody is on the other lanes, a green may last longer than
            `max_green` (SUMO's `extendMaxDur`, off there as here).
        amber: [s]; the authors' network.
        order: the lanes in the order of their greens; None is a, b, c…
        name: short name.
    """

    detector_range: float = 100.0
    min_time_loss: float = 1.0
    min_green: float = 3.0
    max_green: float = 50.0
    extend_max_green: bool = False
    amber: float = 2.0
    order: tuple[int, ...] | None = None
    name: str = "adaptive"

    def __post_init__(self) -> None:
        number("detector_range [m]", self.detector_range, low=1, high=1000)
        number("min_time_loss [s]", self.min_time_loss, low=0, high=3600)
        check_greens(self.min_green, self.max_green)
        instance("extend_max_green", self.extend_max_green, bool)
        number("amber [s]", self.amber, low=0, high=60)
        object.__setattr__(self, "order", lane_order(self.order))
        instance("name", self.name, str)

    def start(self, site: Site) -> PhaseSession:
        """Begin a run; raises `InputError` if `order` is not all lanes, each once."""
        rule = DelayRule(self, site)
        return PhaseSession(
            site,
            rule,
            detector_range=self.detector_range,
            marks=(self.detector_range,),
            min_green=self.min_green,
            amber=self.amber,
            first=rule.order[0],
        )


class DelayRule:
    """Which vehicles prolong a green, and by how much.

    Attributes:
        order: the lanes in the order of their greens.
    """

    def __init__(self, signal: Adaptive, site: Site) -> None:
        self._signal = signal
        self._speed_limit = site.speed_limit
        self.order = full_order(signal.order, site.intersection.n)
        self._entered: dict[int, tuple[float, float]] = {}  # vehicle: time [s], distance [m]

    def see(self, view: View) -> None:
        """Note when and where somebody comes onto a detector."""
        for v in view.vehicles:
            if v.id not in self._entered and 0.0 < v.distance <= self._signal.detector_range:
                self._entered[v.id] = view.time, v.distance

    def judge(self, view: View, lane: int, elapsed: float) -> Verdict:
        """Prolong the phase of `lane`, `elapsed` s old, or pass on to the next lane."""
        signal = self._signal
        present = on_detector(view, signal.detector_range)
        approaching = [v for v in present if v.distance > 0.0]
        self._entered = {v.id: self._entered[v.id] for v in approaching}
        delayed = [v for v in approaching if v.lane == lane and self._is_delayed(v, view.time)]
        times = [v.distance / self._speed_limit for v in delayed]
        in_time = [time for time in times if elapsed + time <= signal.max_green]
        prolongation = max(in_time, default=0.0)
        prolongation = max(prolongation, signal.min_green - elapsed)
        idle = all(v.lane == lane for v in present)
        if idle and (elapsed < signal.max_green or signal.extend_max_green):
            prolongation = max(prolongation, IDLE)
        else:
            prolongation = min(prolongation, signal.max_green - elapsed)
        if prolongation > 0.0:
            return Verdict(lane, prolongation)
        return Verdict(following(self.order, lane), 0.0)

    def _is_delayed(self, vehicle: Observed, now: float) -> bool:
        lost = time_loss(*self._entered[vehicle.id], now, vehicle.distance, self._speed_limit)
        return lost > self._signal.min_time_loss


def time_loss(entered: float, start: float, now: float, distance: float, limit: float) -> float:
    """∫ (1 − v/limit) dt of a vehicle that came onto a detector [s].

    That is the time since then, less what the way since then takes at the limit; so nobody has to
    look in between.

    Args:
        entered: when it came [s].
        start: its distance to the junction then [m].
        now: [s].
        distance: to the junction now [m].
        limit: of speed [m/s].
    """
    return now - entered - (start - distance) / limit
