"""A run as a scene: everything that a player shows of it, as plain data for JSON.

docs/reference/scene.md tells the format. Times are whole steps of the scene after its start.
"""

from __future__ import annotations

import json
import math
from bisect import bisect_right
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from figures.player import vlq
from figures.player.ground import ground, headings, picture_reach, ways
from figures.whole import filmed, heads
from minisim.errors import FileError, number, show
from minisim.files import AnyPath, read_file, write_text
from minisim.names import name_of
from minisim.reasons import Reason
from minisim.results.queues import queueing
from minisim.results.run import Run
from minisim.ticks import first_tick

Scene = dict[str, Any]

#: What a file says that it is, and the version of the format that this version writes and reads.
FORMAT: Final = "minisim scene"
VERSION: Final = 1
#: The keys of every scene.
KEYS: Final = (
    "format", "version", "title", "controller", "demand", "profile", "seed", "provenance", "start",
    "step", "steps", "ground", "ways", "types", "headings", "tracks", "reasons", "heads",
    "collisions",
)  # fmt: skip
#: A scene has at most so many pictures per second: a run with smaller steps is thinned.
RATE: Final = 10.0
#: How much of an approach a scene has at least, for diagrams of it [m].
APPROACH: Final = 120.0


def scene(
    run: Run, *, start: float = 0.0, seconds: float = 60.0, reasons: bool = True
) -> Scene:  # fmt: skip
    """`seconds` of a run from `start` on [s], as plain data.

    What was not recorded is run again (`figures.whole` says what that costs). Without `reasons`
    it is quicker: nothing has to be explained, and signal heads are there only if they are known.

    Raises `InputError` for times that the run does not have, and for a run in SUMO that was not
    recorded.
    """
    number("start [s]", start, low=0)
    number("seconds", seconds, above=0, high=3600)
    run = _told(run, start, start + seconds) if reasons else filmed(
        run, start, start + seconds, everywhere=True
    )  # fmt: skip
    site, what = run.site, run.scenario
    clock = _Clock(run, start, seconds)
    demand = f"{what.density:.0f} veh/h/lane"
    if getattr(what, "recorded", None) is not None:
        demand = f"{len(run.columns.lane)} recorded arrivals"
    tracks, pairs = _tracks(run, clock)
    return {
        "format": FORMAT,
        "version": VERSION,
        "title": what.name,
        "controller": name_of(run.controller),
        "demand": demand,
        "profile": what.profile_name,
        "seed": run.seed,
        "provenance": dict(run.provenance),
        "start": round(clock.first * site.dt, 6),
        "step": round(clock.stride * site.dt, 6),
        "steps": clock.steps,
        "ground": ground(site, run.plan),
        "ways": ways(site),
        "types": [{"name": it.name, "length": it.length, "width": it.width} for it in site.types],
        "headings": {
            f"{p} {kind}": headings(site.intersection.paths[p], site.types[kind])
            for p, kind in pairs
        },
        "tracks": tracks,
        "reasons": _reasons(run, clock, {track["id"] for track in tracks}) if reasons else None,
        "heads": _heads(run, clock) if reasons or run.heads is not None else [],
        "collisions": [
            [clock.step_at(it.time), *it.vehicles]
            for it in run.collisions
            if start <= it.time <= start + seconds
        ],
    }


def write_scene(content: Scene, path: AnyPath) -> None:
    """Write a scene as JSON, whole or not at all; raises `FileError`."""
    write_text(path, dumped(content))


def read_scene(path: AnyPath) -> Scene:
    """Read a scene; raises `FileError` for a file that is none, or of another version."""
    place = show(str(path))
    try:
        content = json.loads(read_file("scene", path))
    except ValueError as error:
        raise FileError(f"{place} is not a scene of minisim: it is not JSON ({error})") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise FileError(f'{place} is not a scene of minisim: it has no "format": "{FORMAT}"')
    if content.get("version") != VERSION:
        found = show(content.get("version"))
        raise FileError(f"{place} is a scene of version {found}; this minisim reads {VERSION}")
    if missing := [key for key in KEYS if key not in content]:
        raise FileError(f"{place} is a scene without {', '.join(missing)}")
    return content


def dumped(content: Any) -> str:
    """As compact JSON."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False)


class _Clock:
    """The steps of a scene: every `stride`-th one of the run from its `first` on."""

    def __init__(self, run: Run, start: float, seconds: float) -> None:
        self.dt = run.site.dt
        self.stride = max(1, round(1.0 / (RATE * self.dt)))
        self.first = first_tick(start, self.dt)
        self.steps = max(1, math.ceil(round(seconds / (self.dt * self.stride), 6)))

    def step_at(self, time: float) -> int:
        """The first step at or after a time [s]; negative before the scene."""
        return math.ceil(round((time / self.dt - self.first) / self.stride, 6))


def _told(run: Run, first: float, last: float) -> Run:
    """The run with all trajectories from `first` to `last` [s], and with reasons if it has any."""
    part = filmed(run, first, last, everywhere=True)
    again = part.reasons is None and part.host["host"] == "minisim"
    return run.explained.run if again else part


def _tracks(run: Run, clock: _Clock) -> tuple[list[dict[str, Any]], set[tuple[int, int]]]:
    """Where the vehicles are, one track each, and which types are on which ways."""
    site = run.site
    reach = picture_reach(site, run.plan)
    trace, rows = run.recorded(max(APPROACH, 1.5 * reach), 1.5 * reach)
    tick = trace["tick"] - clock.first
    order = np.argsort(rows["id"], kind="stable")  # it is by time already
    goes = _decided(rows["id"][order], trace["released"][order] != 0)
    shown = (tick >= 0) & (tick <= clock.steps * clock.stride) & (tick % clock.stride == 0)
    goes, order = goes[shown[order]], order[shown[order]]
    if not len(order):
        return [], set()
    vehicle, path, kind = rows["id"][order], rows["path"][order], rows["type"][order]
    step, s, v = tick[order] // clock.stride, trace["s"][order], trace["v"][order]
    clear = np.array([it.exit for it in site.intersection.paths])[path]
    clear += np.array([it.length for it in site.types])[kind]
    goes &= s <= clear
    new = (np.diff(vehicle, prepend=-1) != 0) | (np.diff(step, prepend=-1) != 1)
    state = 2 * goes + queueing(v, new)  # see docs/reference/scene.md
    starts = np.flatnonzero(new)
    centimetres = np.round(100.0 * s).astype(np.int64)
    texts = vlq.encoded(vlq.second_differences(centimetres, starts), starts)
    harmed: dict[int, int] = {}
    for it in run.collisions:
        for hit in it.vehicles:
            harmed.setdefault(hit, clock.step_at(it.time))
    tracks = []
    for text, a, b in zip(texts, starts.tolist(), [*starts[1:].tolist(), len(s)], strict=True):
        changes = a + np.flatnonzero(np.diff(state[a:b], prepend=-1))
        out = np.flatnonzero(s[a:b] > clear[a:b])
        me = int(vehicle[a])
        track = {
            "id": me, "way": int(path[a]), "type": int(kind[a]), "from": int(step[a]), "s": text,
            "states": np.stack([step[changes], state[changes]], axis=-1).ravel().tolist(),
        }  # fmt: skip
        if len(out) and out[0]:  # a vehicle that is clear from the start does not count
            track["clear"] = int(step[a + out[0]])
        if me in harmed:
            track["harmed"] = harmed[me]
        if run.kinds and run.kinds[me] == "human":
            track["human"] = True
        tracks.append(track)
    pairs = np.unique(np.stack([path, kind], axis=-1), axis=0).tolist()
    return tracks, {(p, k) for p, k in pairs}


def _decided(vehicle: vlq.Ints, released: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Which vehicles have the right of way from each row on; rows are by vehicle, then time.

    A row has what held in the step that ended then, so the next one has what was decided at its
    time, as reasons and signal heads have it.
    """
    later = released.copy()
    later[:-1] = np.where(np.diff(vehicle) == 0, released[1:], released[:-1])
    return later


def _reasons(run: Run, clock: _Clock, vehicles: set[int]) -> Mapping[str, list[list[Any]]]:
    """Why each of these vehicles waits or goes: by vehicle, lists of step, kind, sentence, others.

    They are those of `Run.why`: before the first that was written down, a vehicle is free or behind
    another one in its lane.
    """
    if run.reasons is None:
        return {}
    told: dict[int, list[tuple[int, Reason]]] = {}
    for time, reason in run.reasons:
        told.setdefault(reason.vehicle, []).append((clock.step_at(time), reason))
    found: dict[str, list[list[Any]]] = {}
    before = _places(run, clock)
    for vehicle in sorted(vehicles):
        said = told.get(vehicle, [])
        known = said[0][0] if said else clock.steps + 1
        said = [it for it in before.get(vehicle, ()) if it[0] < known] + said
        begin = max(bisect_right(said, 0, key=lambda it: it[0]) - 1, 0)
        found[str(vehicle)] = [
            [max(step, 0), it.kind, it.sentence, list(it.vehicles)]
            for step, it in said[begin:]
            if step <= clock.steps
        ]
    return found


def _places(run: Run, clock: _Clock) -> Mapping[int, list[tuple[int, Reason]]]:
    """What its place on the approach tells of each vehicle: it is free, or behind another one."""
    trace, rows = run.recorded()
    entry, tick = run.site.intersection.approach_length, trace["tick"] - clock.first
    here = np.flatnonzero((trace["s"] < entry) & (tick >= 0) & (tick <= clock.steps * clock.stride))
    lanes = run.site.intersection.movements.origins[rows["path"]]
    order = here[np.lexsort((-trace["s"][here], lanes[here], tick[here]))]
    tick, lane, vehicle = tick[order], lanes[order], rows["id"][order]
    ahead = np.concatenate([[-1], vehicle[:-1]])
    ahead[(np.diff(tick, prepend=-1) != 0) | (np.diff(lane, prepend=-1) != 0)] = -1
    by_vehicle = np.argsort(vehicle, kind="stable")
    tick, vehicle, ahead = tick[by_vehicle], vehicle[by_vehicle], ahead[by_vehicle]
    new = (np.diff(vehicle, prepend=-1) != 0) | (np.diff(ahead, prepend=-2) != 0)
    places: dict[int, list[tuple[int, Reason]]] = {}
    for k in np.flatnonzero(new).tolist():
        me, other = int(vehicle[k]), int(ahead[k])
        reason = Reason("free", me) if other < 0 else Reason("behind", me, (other,))
        places.setdefault(me, []).append((-(-int(tick[k]) // clock.stride), reason))
    return places


def _heads(run: Run, clock: _Clock) -> list[list[Any]]:
    """What signal heads show: step, lane, state; those of before the scene are at step 0."""
    before: dict[int, list[Any]] = {}
    later = []
    for time, lane, state in heads(run):
        step = clock.step_at(time)
        if step <= 0:
            before[lane] = [0, lane, state]
        elif step <= clock.steps:
            later.append([step, lane, state])
    return [*before.values(), *later]
