"""Max-pressure at one junction (Varaiya, Transp. Res. C 36 (2013): 177–195).

Max-pressure gives green to the phase with the largest sum, over its movements, of saturation flow
times the queue before the junction minus the queue beyond it. It needs no forecast of the demand,
and keeps queues bounded at every demand that any signal could serve. Here, beyond the junction
vehicles drive freely off, so the queue there is 0, and all lanes have the same saturation flow.
What is left is the sum of the queues of a phase; with one approach per phase, the longest queue
goes first.
"""

from __future__ import annotations

import math
from collections import Counter

from baselines.signals.facing import facing_switch
from baselines.signals.permitted import PermittedHeads
from baselines.signals.phases import PhaseSession, Verdict, on_detector
from minisim.control import Site, View
from minisim.names import Name
from minisim.parameters import Switch, declared, real


@declared
class MaxPressure:
    """A signal that turns to the approaches with the most vehicles, every few seconds.

    One phase per approach: one lane carries all turns, so any two approaches have movements that
    conflict. If `facing`, those that face each other are a phase, and their queues are added. Of
    equal sums, the phase whose last green was longest ago goes first; further ties go in the order
    a, b, c…. An empty junction keeps its green. A lane of few vehicles may wait long.
    """

    name = Name("max-pressure")
    lights = True

    # 5–10 s are usual; the code of Genders & Razavi (arXiv 1909.00395) has 5 s for roads of
    # several lanes. A change costs some 3 s, so single lanes need the upper end.
    interval: float = real(
        "green between two looks, counted from when the green is shown", "s",
        low=0.5, high=3600, default=10.0,
    )  # fmt: skip
    # Any will do: the first vehicle of a queue stands within `SUMO_AT_LINE`. DIM sees 8 m.
    detector_range: float = real(
        "length of approach on which a queue is counted; by default as for `Adaptive`", "m",
        low=2, high=1000, default=100.0,
    )  # fmt: skip
    # As for `Adaptive`, and in the code of Genders & Razavi.
    amber: float = real("amber after each green", "s", low=0, high=60, default=2.0)
    facing: Switch = facing_switch()

    def start(self, site: Site) -> PressureSession:
        """Begin a run; raises `InputError` for vehicles that `facing` cannot hold one by one."""
        return PressureSession(self, site)


class PressureSession(PhaseSession):
    """Which phase has the largest pressure."""

    def __init__(self, signal: MaxPressure, site: Site) -> None:
        super().__init__(
            site, signal.detector_range, signal.interval, signal.amber,
            facing=PermittedHeads(site, signal.name) if signal.facing else None,
        )  # fmt: skip
        self._signal = signal
        self._last_green = [-math.inf] * site.intersection.n  # [s]

    def judge(self, view: View, lane: int, elapsed: float) -> Verdict:  # noqa: ARG002  (PhaseSession's)
        """Choose the phase with the largest pressure; look again after another interval."""
        self._last_green[lane] = view.time
        present = on_detector(view, self._signal.detector_range)
        queues = Counter(v.lane for v in present if v.distance >= 0.0)
        pressures = {k: sum(queues[one] for one in phase) for k, phase in self._phases.items()}
        if queues:
            lane = min(pressures, key=lambda k: (-pressures[k], self._last_green[k], k))
        return Verdict(lane, self._signal.interval)
