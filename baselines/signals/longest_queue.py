"""The longest-queue-first signal: max-pressure at one junction.

Max-pressure (Varaiya, Transp. Res. C 36 (2013): 177–195) gives green to the phase with the largest
sum, over its movements, of the queue before the junction minus the queue beyond it. At a single
junction whose exits flow freely there is no queue beyond it, so the longest queue goes first.
"""

from __future__ import annotations

import math
from collections import Counter

from baselines.signals.phases import PhaseSession, Verdict, check_detector, on_detector
from minisim.control import Site, View
from minisim.names import Name
from minisim.parameters import declared, real


@declared
class LongestQueue:
    """A signal that turns to the approach with the most vehicles, every few seconds.

    One phase per approach: one lane carries all turns, so any two approaches have movements that
    conflict. Of equal queues, the one whose last green was longest ago goes first; further ties go
    in the order a, b, c…. An empty junction keeps its green. A lane of few vehicles may wait long.
    """

    name = Name("longest-queue")

    # 5–10 s are usual; the code of Genders & Razavi (arXiv 1909.00395) has 5 s for roads of
    # several lanes. A change costs some 3 s, so single lanes need the upper end.
    interval: float = real(
        "green between two looks, counted from when the green is shown", "s",
        low=0.5, high=3600, default=10.0,
    )  # fmt: skip
    detector_range: float = real(
        "length of approach on which a queue is counted, as for `Adaptive`", "m",
        low=1, high=1000, default=100.0,
    )  # fmt: skip
    # As for `Adaptive`, and in the code of Genders & Razavi.
    amber: float = real("amber after each green", "s", low=0, high=60, default=2.0)

    def start(self, site: Site) -> QueueSession:
        """Begin a run; raises `InputError` for a detector that is too short."""
        check_detector(self.detector_range, site)
        return QueueSession(self, site)


class QueueSession(PhaseSession):
    """Which queue is the longest."""

    def __init__(self, signal: LongestQueue, site: Site) -> None:
        super().__init__(site, signal.detector_range, signal.interval, signal.amber)
        self._signal = signal
        self._last_green = [-math.inf] * site.intersection.n  # [s]

    def judge(self, view: View, lane: int, elapsed: float) -> Verdict:  # noqa: ARG002  (PhaseSession's)
        """Choose the lane with the longest queue; look again after another interval."""
        self._last_green[lane] = view.time
        present = on_detector(view, self._signal.detector_range)
        queues = Counter(v.lane for v in present if v.distance >= 0.0)
        if queues:
            lane = min(queues, key=lambda k: (-queues[k], self._last_green[k], k))
        return Verdict(lane, self._signal.interval)
