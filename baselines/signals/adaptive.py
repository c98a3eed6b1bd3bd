"""The adaptive signal: a phase lasts while delayed vehicles can still make use of it.

It follows SUMO's traffic light type `delay_based` (`MSDelayBasedTrafficLightLogic`; its
documentation cites Oertel & Wagner, TRB 2011).
"""

from __future__ import annotations

from baselines.signals import phases
from baselines.signals.heads import lane_order
from baselines.signals.phases import PhaseSession, Verdict
from minisim.control import Site, View
from minisim.names import Name
from minisim.parameters import Switch, declared, real, switch

#: Time after which an idle signal looks again [s]; fixed in SUMO's code.
IDLE = 1.0


@declared
class Adaptive:
    """A signal that prolongs a green for vehicles that have lost time before the junction.

    One phase per approach, in a fixed order; none is left out. A vehicle that has lost more
    than `min_time_loss` on the last `detector_range` metres prolongs its lane's green by the time
    it needs to reach the stop line at the speed limit, if that is before `max_green`. A green also
    goes on while the other lanes are empty. Time loss is relative to the speed that the driver
    would like (`MSE2Collector`). Defaults are SUMO's; greens and amber are the authors'.
    """

    name = Name("adaptive")

    detector_range: float = real("length of the detectors", "m", low=1, high=1000, default=100.0)
    min_time_loss: float = real(
        "time lost from which a vehicle prolongs the green", "s",
        low=0, high=3600, default=1.0,
    )  # fmt: skip
    # The authors' network: `minDur`, `maxDur` and its amber.
    min_green: float = real("shortest green", "s", low=0.5, high=3600, default=3.0)
    max_green: float = real("longest green", "s", low=0.5, high=3600, default=50.0)
    extend_max_green: Switch = switch(
        "whether a green may last longer than `max_green` while the other lanes are empty (SUMO's "
        "`extendMaxDur`)", default=False,
    )  # fmt: skip
    amber: float = real("amber after each green", "s", low=0, high=60, default=2.0)
    order: tuple[int, ...] | None = lane_order()

    def __post_init__(self) -> None:
        phases.check_greens(self.min_green, self.max_green)

    def start(self, site: Site) -> DelaySession:
        """Begin a run; raises `InputError` for a bad `order` or a detector that is too short."""
        phases.check_detector(self.detector_range, site)
        return DelaySession(self, site)


class DelaySession(PhaseSession):
    """Which vehicles prolong a green, and by how much."""

    def __init__(self, signal: Adaptive, site: Site) -> None:
        reach = signal.detector_range
        super().__init__(site, reach, signal.min_green, signal.amber, (reach,), signal.order)
        self._signal = signal
        self._limit = site.limit
        self._entered: dict[int, tuple[float, float]] = {}  # vehicle: time [s], distance [m]

    def see(self, view: View) -> None:
        """Note when and where a vehicle comes onto a detector."""
        reach = self._signal.detector_range
        for v in view.vehicles:
            if v.id not in self._entered and 0.0 < v.distance <= reach:
                # SUMO also counts the part of the step after the entry.
                past = (reach - v.distance) if self._exact and v.speed > 0.0 else 0.0
                since = view.time - (past / v.speed if past else 0.0)
                self._entered[v.id] = since, v.distance + past

    def judge(self, view: View, lane: int, elapsed: float) -> Verdict:
        """Prolong the phase of `lane`, which is `elapsed` s old, or go on to the next lane."""
        signal = self._signal
        present = phases.on_detector(view, signal.detector_range)
        approaching = [v for v in present if v.distance > 0.0]
        self._entered = {v.id: self._entered[v.id] for v in approaching}
        now = view.time
        times = []
        for v in approaching:
            limit = self._limit(v.lane)
            lost = time_loss(*self._entered[v.id], now, v.distance, limit * v.speed_factor)
            if v.lane == lane and lost > signal.min_time_loss:
                times.append(self.duration(v.distance / limit))
        in_time = [time for time in times if elapsed + time <= signal.max_green]
        prolongation = max(0.0, signal.min_green - elapsed, *in_time)
        idle = all(v.lane == lane for v in present)
        if idle and (elapsed < signal.max_green or signal.extend_max_green):
            prolongation = max(prolongation, IDLE)
        else:
            prolongation = min(prolongation, signal.max_green - elapsed)
        return Verdict(lane, prolongation) if prolongation > 0.0 else self.pass_on(lane)


def time_loss(entered: float, start: float, now: float, distance: float, limit: float) -> float:
    """∫ (1 − v/limit) dt of a vehicle that came onto a detector at `entered`, `start` m away [s].

    That is the time since then, less what the same way takes at the limit [m/s].
    """
    return now - entered - (start - distance) / limit
