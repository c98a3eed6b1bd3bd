"""Reasons are true: an oracle that knows only trajectories and geometry agrees with each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from dim import Dim, HarmonyMatrix, Mixed, Monitor, NoisyPerception
from minisim import simulate
from minisim.channel import Channel
from minisim.control import Controller, Observed, can_stop
from minisim.junction.movements import ARM_NAMES, Movement
from minisim.link import Linked
from minisim.reasons import KINDS, Explaining, Reason, Signalling
from minisim.results.run import Run
from minisim.sumo import simulate as simulate_in_sumo
from scenarios import five_way, four_way, three_way
from scenarios.controllers import CONTROLLERS as TABLE
from scenarios.controllers import controller_named, safe
from tests.builders import digest, seen

CONTROLLERS: tuple[Controller, ...] = (
    *map(controller_named, safe()),
    Dim(gate="harmonious", priorities="waiting"),
    Dim(order="lanes", monitor=Monitor()),
    Mixed(share=0.3),
    Mixed(Dim(gate="harmonious"), 0.6),
)
#: A vehicle this slow waits, as in the metric of waiting time [m/s].
WAITS = 0.1
#: Kinds that are told of messages.
MESSAGES = ("not heard", "not told", "told for later", "in doubt")


class Oracle:
    """Where all vehicles of a run are, from its recorded trajectories alone."""

    def __init__(self, run: Run) -> None:
        self.run, self.site = run, run.site
        frame = run.trajectories
        paths = run.site.intersection.paths
        index = run.site.intersection.movements.index_of
        lanes = {name: k for k, name in enumerate(ARM_NAMES)}
        frame = frame.assign(arm=frame["lane"].astype(str).map(lanes))
        # A row shows what held in the step that ended then; a reason is of the decision made then.
        later = frame.groupby("vehicle")["right_of_way"].shift(-1)
        frame["right_of_way"] = later.fillna(frame["right_of_way"]).astype(bool)
        way = index[frame["arm"].to_numpy(), frame["manoeuvre"].to_numpy()]
        exits = np.array([path.exit for path in paths])[way]
        frame = frame.assign(
            way=way, distance=paths[0].entry - frame["s_m"],
            inside=(frame["s_m"] > paths[0].entry)
            & (frame["s_m"] - run.site.vehicle.length < exits),
        )  # fmt: skip
        self.times = dict(iter(frame.groupby("time_s")))
        self.frame = frame

    def at(self, time: float) -> pd.DataFrame:
        """All vehicles at a time, by number."""
        rows: pd.DataFrame = self.times[time].set_index("vehicle")
        return rows

    def check(self, reason: Reason, time: float) -> None:
        """Fail unless the reason is true at that time."""
        now = self.at(time)
        me = now.loc[reason.vehicle]
        others = now.loc[list(reason.vehicles)]
        conflicts = self.site.conflicts
        before = me.distance >= 0.0
        waits, goes = before and not me.right_of_way, before and me.right_of_way
        match reason.kind:
            case "crossing":
                assert not before
            case "left":
                assert me.distance < 0.0
                assert not me.inside
            case "goes" | "clique goes" | "committed" | "advised" | "told":
                assert goes
                stops = can_stop(_observed(me), self.site.vehicle.deceleration)
                assert (reason.kind == "committed") <= (not stops)
            case "behind":
                ahead = now[(now.arm == me.arm) & (now.distance < me.distance)]
                assert reason.vehicles == (ahead[ahead.distance >= 0.0].distance.idxmax(),)
            case "free":
                ahead = now[(now.arm == me.arm) & (now.distance < me.distance)]
                assert not (ahead.distance >= 0.0).any()
            case "not clear":
                assert waits
                inside = set(now.index[now.inside])
                assert inside <= set(reason.vehicles)
                gone = others[~others.inside]
                brakes = self.site.vehicle.deceleration
                assert not any(can_stop(_observed(it), brakes) for it in gone.itertuples())
            case "not in harmony" | "held for" | "clearing" | "gap":
                assert waits
                assert all(it.inside or it.right_of_way for it in others.itertuples())
                assert all(self._matrix_or(conflicts, me, it) for it in others.itertuples())
            case "other clique":
                assert waits
                assert len(others)
                assert all(it.right_of_way for it in others.itertuples())
                assert all(self._apart(me, it) for it in others.itertuples())
                assert str(_movement(me)) not in reason.clique
                members = [
                    Movement(ARM_NAMES.index(name[0]), int(name[1:])) for name in reason.clique
                ]
                matrix = self.harmony
                assert all(matrix.harmony(a, b) for a in members for b in members if a != b)
            case "red" | "amber":
                assert waits
                assert reason.since is not None
                assert reason.since <= time
                assert reason.until is None or reason.until > time - 0.5
            case "passage":
                assert goes
                assert reason.until is not None
            case "no passage" | "after" | "listed":
                assert waits
                assert (others.inside | others.right_of_way | (others.distance >= 0.0)).all()
                assert all(conflicts[me.way, it.way] for it in others.itertuples())
                assert not (others.arm == me.arm).any()
                assert (reason.until is not None) == (reason.kind == "after")
            case "planned":
                assert waits
            case "approaching":
                assert waits
            case "turn" | "reaction":
                assert waits
                assert me.speed_mps <= 0.5
            case "others first" | "held" | "comes" | "looks again" | "intent unknown":
                assert waits
            case "monitor":
                assert len(others)
            case kind:
                pytest.fail(f"no oracle for {kind}")

    @property
    def harmony(self) -> HarmonyMatrix:
        return HarmonyMatrix.from_geometry(self.site.intersection, self.site.fleet)

    def _apart(self, one: Any, other: Any) -> bool:
        return not self.harmony.harmony(_movement(one), _movement(other))

    def _matrix_or(self, conflicts: Any, one: Any, other: Any) -> bool:
        if self.run.kinds and self.run.kinds[other.Index] == "human":
            return True  # others do not trust what it says it will do
        return bool(conflicts[one.way, other.way]) or self._apart(one, other)


def _observed(row: Any) -> Observed:
    return seen(0, int(row.arm), int(row.manoeuvre), float(row.distance), float(row.speed_mps))


def _movement(row: Any) -> Movement:
    return Movement(int(row.arm), int(row.manoeuvre))


def _check(run: Run, pairs: int, seed: int) -> None:
    """Check that many random vehicles at random times; one that waits has a reason to."""
    oracle = Oracle(run)
    rows = oracle.frame
    rows = rows[rows.time_s > 0.0]
    chosen = rows.sample(pairs, random_state=seed, replace=True)
    for row in chosen.itertuples():
        reason = run.why(int(row.vehicle), float(row.time_s))
        assert reason.sentence.startswith(("Vehicle", "It is", "The driver"))
        oracle.check(reason, row.time_s)
        if row.speed_mps < WAITS and row.distance >= 0.0:
            assert reason.kind not in ("free", "left", "crossing")


@pytest.mark.parametrize("controller", CONTROLLERS, ids=lambda c: c.name)
def test_reasons_agree_with_the_trajectories(controller: Controller) -> None:
    run = simulate(four_way(350, horizon=200.0), controller, 3, record="all", explain=True)
    _check(run, 40, 1)


FAILING = Channel(latency=0.2, jitter=0.1, loss=0.2)


#: Of these, only what they command is known.
SILENT = {"dim-as-run", "v2ic-as-run", "unregulated"}


@pytest.mark.parametrize("name", [name for name in TABLE if name not in SILENT])
def test_each_controller_says_why_or_shows_heads(name: str) -> None:
    session = controller_named(name).start(four_way(100).site(0))
    assert isinstance(session, Explaining | Signalling)


@pytest.mark.parametrize("name", ["v2ic", "reservation", "slots"])
def test_reasons_are_true_if_messages_fail(name: str) -> None:
    linked = Linked(controller_named(name), FAILING)
    run = simulate(four_way(350, horizon=200.0), linked, 3, record="all", explain=True)
    oracle = Oracle(run)
    told = [it for it in run.reasons or () if it.reason.kind in MESSAGES]
    assert {it.reason.kind for it in told} >= {"not told", "not heard"}
    for time, reason in told:
        me = oracle.at(time).loc[reason.vehicle]
        assert me.distance >= 0.0
        assert not me.right_of_way


@pytest.mark.slow
@pytest.mark.parametrize("controller", CONTROLLERS, ids=lambda c: c.name)
@pytest.mark.parametrize("make", [three_way, four_way, five_way])
def test_many_reasons_agree_with_the_trajectories(controller: Controller, make: Any) -> None:
    run = simulate(make(300, horizon=500.0), controller, 1, record="all", explain=True)
    _check(run, 200, 1)  # 13,800 with all controllers and junctions


@pytest.mark.parametrize("controller", CONTROLLERS, ids=lambda c: c.name)
def test_explaining_changes_no_trip(controller: Controller) -> None:
    scenario = four_way(350, horizon=150.0)
    plain, asked = (simulate(scenario, controller, 2, explain=it) for it in (False, True))
    assert digest(plain) == digest(asked)
    assert plain.reasons is None
    assert asked.reasons


def test_no_session_is_asked_unless_a_run_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    from dim.controller import DimSession

    asked: list[float] = []
    whole = DimSession.reasons
    monkeypatch.setattr(
        DimSession, "reasons", lambda self, view: asked.append(view.time) or whole(self, view)
    )
    scenario = four_way(350, horizon=120.0)
    simulate(scenario, Dim())
    assert not asked
    simulate(scenario, Dim(), explain=True)
    assert len(asked) > 1000  # each step


@pytest.mark.sumo
def test_reasons_in_sumo_are_those_of_its_wake_ups() -> None:
    run = simulate_in_sumo(four_way(350, horizon=120.0), Dim(), record="all", explain=True)
    assert run.reasons
    assert {told.reason.kind for told in run.reasons} <= set(KINDS)
    vehicle = run.reasons[0].reason.vehicle
    assert run.why(vehicle, run.reasons[0].time) == run.reasons[0].reason


def test_misread_intents_are_told_as_the_vehicle_sees_them() -> None:
    noisy = Dim(perception=NoisyPerception(intent_error=0.3, kind="symmetric"), monitor=Monitor())
    run = simulate(four_way(350, horizon=600.0), noisy, 1, explain=True, on_collision="record")
    kinds = {told.reason.kind for told in run.reasons or ()}
    assert "monitor" in kinds
