"""The recorded trajectories of a run as arrays, and what `animate` draws at a time."""

from __future__ import annotations

from bisect import bisect_right
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from figures.junction import drawing
from figures.whole import HeadSpan, head_spans
from minisim.errors import InputError
from minisim.junction.movements import Bools
from minisim.junction.paths import Floats
from minisim.junction.turns import indicator
from minisim.results.queues import queueing
from minisim.results.run import Run
from minisim.results.trajectories import movement_index

if TYPE_CHECKING:
    import pandas as pd

Rows = npt.NDArray[np.int64]

#: States of a vehicle.
DRIVING, QUEUEING, RELEASED = 0, 1, 2
#: A collision is marked for this long [s] by a ring of this radius [m].
COLLISION_SHOWN, RING = 3.0, 5.0
#: The middle of the roof is this share of a body's length behind its front, and the arrow on it
#: has these corners [m].
ROOF = 0.68
ARROW = np.array([
    (0.85, 0.0), (0.1, 0.75), (0.1, 0.25), (-0.8, 0.25), (-0.8, -0.25), (0.1, -0.25), (0.1, -0.75)
])  # fmt: skip


class Frames:
    """The recorded trajectories as arrays, one row per vehicle and step."""

    def __init__(self, run: Run, start: float) -> None:
        frame = run.trajectories
        if frame.empty:
            raise InputError(
                f"no vehicle was recorded from {start:g} s on; start later or raise the density"
            )
        site = run.site
        self.run, self.start = run, start
        self.x, self.y = frame["x_m"].to_numpy(), frame["y_m"].to_numpy()
        self.angle, self.s = frame["angle_deg"].to_numpy(), frame["s_m"].to_numpy()
        self.path = movement_index(frame, site)
        self.lane = site.intersection.movements.origins[self.path]
        paths = site.intersection.paths
        self.turn = np.array([indicator(path) for path in paths])
        self.exit = np.array([p.exit for p in paths])
        self.entry = paths[0].entry
        self.type = run.columns.type[frame["vehicle"].to_numpy()]
        clear = self.exit[self.path] + np.array([it.length for it in site.types])[self.type]
        released = frame["right_of_way"].to_numpy() & (self.s <= clear)
        self.queueing = _queueing(frame)
        self.state = np.where(released, RELEASED, np.where(self.queueing, QUEUEING, DRIVING))
        self._bearing = np.array([site.intersection.arms[p.exit_arm].bearing for p in paths])
        self._heads: dict[int, list[HeadSpan]] = {}
        for span in head_spans(run):
            self._heads.setdefault(span.lane, []).append(span)
        human = np.array(run.kinds or [""] * len(run.columns.lane)) == "human"
        self.human = human[frame["vehicle"].to_numpy()]
        harmed = np.full(len(human), np.inf)
        for collision in run.collisions:
            for vehicle in collision.vehicles:
                harmed[vehicle] = min(harmed[vehicle], collision.time)
        self.harmed = harmed[frame["vehicle"].to_numpy()]
        ticks = np.round(frame["time_s"].to_numpy() / site.dt).astype(np.int64)
        shown, first = np.unique(ticks, return_index=True)
        bounds = np.append(first, len(ticks)).tolist()
        parts = [slice(*ends) for ends in pairwise(bounds)]
        self._steps: dict[int, slice] = dict(zip(shown.tolist(), parts, strict=True))
        self.busiest = float(shown[int(np.argmax(np.diff(bounds)))] * site.dt)
        gone = frame[(self.s > clear) & np.isinf(self.harmed)].groupby("vehicle")["time_s"].min()
        cleared = np.sort(gone.to_numpy())
        # A vehicle that was clear before the first frame does not count as served.
        self.cleared = cleared[cleared > max(start, frame["time_s"].iloc[0])]

    def at(self, time: float) -> slice:
        """The rows of one step."""
        return self._steps.get(round(time / self.run.site.dt), slice(0, 0))

    def rows(self, now: slice, reach: float) -> Rows:
        """The rows of one step that lie in the picture."""
        rows = np.arange(now.start, now.stop)
        inside = np.maximum(np.abs(self.x[now]), np.abs(self.y[now])) <= reach
        return np.asarray(rows[inside])

    def waiting(self, rows: Rows) -> int:
        """How many of these vehicles are in a queue."""
        return int(self.queueing[rows].sum())

    def served(self, time: float) -> int:
        """How many vehicles have cleared the junction since the film began, without a collision."""
        return int(np.searchsorted(self.cleared, time, side="right"))

    def collided(self, time: float) -> int:
        """How many collisions there have been since the film began."""
        return sum(self.start <= c.time <= time for c in self.run.collisions)

    def open_lanes(self, rows: Rows) -> set[int]:
        """Lanes whose first vehicle before the junction has the right of way."""
        before = rows[self.s[rows] <= self.entry]
        nearest_last = before[np.argsort(self.s[before], kind="stable")].tolist()
        first = {int(self.lane[row]): row for row in nearest_last}
        return {lane for lane, row in first.items() if self.state[row] == RELEASED}

    @property
    def signalled(self) -> bool:
        """Whether the junction has signal heads."""
        return bool(self._heads)

    def heads(self, time: float) -> dict[int, str]:
        """What the head of each lane shows; empty without signals."""
        now = time + self.run.site.dt / 2.0
        return {
            lane: spans[max(bisect_right(spans, now, key=lambda it: it.start) - 1, 0)].state
            for lane, spans in self._heads.items()
        }

    def arrows(self, rows: Rows) -> list[Floats]:
        """On the roof of each vehicle up to the exit: an arrow to the arm by which it leaves."""
        rows = rows[self.s[rows] <= self.exit[self.path[rows]]]
        lengths = np.array([it.length for it in self.run.site.types])[self.type[rows]]
        heading = np.radians(self.angle[rows])
        x = self.x[rows] - ROOF * lengths * np.sin(heading)
        y = self.y[rows] - ROOF * lengths * np.cos(heading)
        return list(drawing.place(ARROW, x, y, self._bearing[self.path[rows]]))

    def ways(self, rows: Rows) -> list[Floats]:
        """The rest of the path, up to the exit, of each vehicle with the right of way."""
        plan, paths = self.run.plan, self.run.site.intersection.paths
        begin = self.entry - max(plan.hold_distance, 1.0)
        rests = []
        near = self.s[rows] > self.entry - plan.sight
        for row in rows[(self.state[rows] == RELEASED) & near].tolist():
            path = paths[self.path[row]]
            start = max(begin, float(self.s[row]))
            if start < path.exit:
                rests.append(path.position(np.linspace(start, path.exit, 16)))
        return rests

    def lamps(self, rows: Rows) -> list[Floats]:
        """Turn indicators of turning vehicles that have not left the junction."""
        size = 0.36
        lamp = np.array([(0.1, -size), (0.1, size), (-2 * size, size), (-2 * size, -size)])
        sides = self.turn[self.path[rows]]
        turning = (self.s[rows] <= self.exit[self.path[rows]]) & (sides != 0)
        rows, sides = rows[turning], sides[turning]
        half = np.array([it.width / 2.0 for it in self.run.site.types])[self.type[rows]]
        back = np.array([it.length - 2 * size + 0.2 for it in self.run.site.types])[self.type[rows]]
        lamps: list[Floats] = []
        for behind in (0.0 * back, back):
            shapes = lamp - np.stack([behind, sides * half], axis=-1)[:, None]
            lamps += list(drawing.place(shapes, self.x[rows], self.y[rows], self.angle[rows]))
        return lamps

    def crossed_out(self, rows: Rows, time: float) -> list[Floats]:
        """Two strokes across each of these vehicles that has collided."""
        vehicle = self.run.site.vehicle
        half = vehicle.width / 2.0
        rows = rows[self.harmed[rows] <= time + self.run.site.dt / 2.0]
        where = (self.x[rows], self.y[rows], self.angle[rows])
        strokes = (np.array([(0.0, y), (-vehicle.length, -y)]) for y in (half, -half))
        return [stroke for shape in strokes for stroke in drawing.place(shape, *where)]

    def crashes(self, time: float) -> list[Floats]:
        """A ring around each recent collision."""
        site = self.run.site
        angle = np.linspace(0.0, 2.0 * np.pi, 49)
        ring = RING * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        rings: list[Floats] = []
        for collision in self.run.collisions:
            if not 0.0 <= time - collision.time <= COLLISION_SHOWN:
                continue
            movements = map(site.intersection.parse, collision.movements)
            types = [site.types[self.run.columns.type[id]] for id in collision.vehicles]
            centres = [
                site.intersection.path(movement).pose(s, it)[0]
                for movement, s, it in zip(movements, collision.positions, types, strict=True)
            ]
            rings.append(ring + np.mean(centres, axis=0))
        return rings


def _queueing(frame: pd.DataFrame) -> Bools:
    """Which rows of trajectories, which are sorted by time, are of a vehicle in a queue."""
    vehicle, speed = frame["vehicle"].to_numpy(), frame["speed_mps"].to_numpy()
    order = np.argsort(vehicle, kind="stable")
    out = np.empty(len(frame), dtype=bool)
    out[order] = queueing(speed[order], np.diff(vehicle[order], prepend=-1) != 0)
    return out
