"""DIM as a controller: its plan, and its commands on hand-made views."""

from __future__ import annotations

import pickle
from dataclasses import dataclass

import numpy as np
import pytest

from dim import Dim, HarmonyMatrix, Zones
from dim.agent import GATES
from dim.perception import COMMITS, See
from minisim.control import Go, Observed, Site, View
from minisim.errors import InputError
from minisim.junction.geometry import Intersection
from scenarios import five_way, four_way, three_way
from tests.builders import car, said, view


class Scene:
    """A session on the paper's 4 arms that is shown one view after the other."""

    def __init__(self, dim: Dim, site: Site | None = None) -> None:
        self.session = dim.start(four_way().site() if site is None else site)
        self.time = 0.0

    def show(self, *cars: Observed) -> str:
        """The commands as text, such as `Go 1, Hold 2`."""
        self.time += 1.0
        return ", ".join(said(self.session.decide(view(*cars, time=self.time))))


#: Under this gate, one that waits while others cross looks again.
AGAIN = {"passed": "Wake 3.1"}
EVERY_GATE = pytest.mark.parametrize("gate", GATES)


@EVERY_GATE
def test_alone_it_goes_at_the_yellow_zone_and_is_told_once(gate: str) -> None:
    scene = Scene(Dim(gate=gate))
    assert scene.show(car(1, "b3", 8.4, 5.0)) == ""
    assert scene.show(car(1, "b3", 8.0, 4.8)) == "Go 1"
    assert scene.show(car(1, "b3", 6.0, 4.8)) == ""
    assert scene.show(car(1, "b3", 2.0, 5.0)) == ""
    assert scene.show(car(1, "b3", -8.0, 5.0)) == ""
    assert scene.show() == ""


def test_a_late_arrival_waits_until_the_junction_is_clear() -> None:
    """The paper's case 2: decisions stand while a vehicle crosses, even in harmony."""
    scene = Scene(Dim())
    assert scene.show(car(1, "c2", 7.9, 4.8)) == "Go 1"
    assert scene.show(car(1, "c2", -3.0, 5.0), car(2, "a1", 8.0, 4.8)) == ""
    assert scene.show(car(1, "c2", -9.0, 5.0), car(2, "a1", 2.2)) == ""
    assert scene.show(car(2, "a1", 2.2)) == "Go 2"


def test_under_the_gate_passed_it_enters_once_the_one_inside_is_out_of_its_way() -> None:
    for gate in GATES:
        scene = Scene(Dim(gate=gate))
        b = car(2, "b2", -4.0, 5.0)
        assert scene.show(car(2, "b2", 2.2)) == "Go 2"
        waits = scene.show(b, car(3, "c2", 2.2))
        assert waits.startswith("Wake") == (gate == "passed")
        goes = scene.show(b._replace(distance=-15.5), car(3, "c2", 2.2))
        assert goes == ("Go 3" if gate == "passed" else "")


@EVERY_GATE
def test_a_new_decision_revokes_an_unused_right_of_way(gate: str) -> None:
    scene = Scene(Dim(gate=gate))
    assert scene.show(car(3, "c2", 2.2)) == "Go 3"
    assert scene.show(car(3, "c2", 2.1, 0.6), car(2, "b2", 8.0, 4.8)) == "Go 2, Hold 3"
    # and back, when that one has gone
    assert scene.show(car(3, "c2", 1.9), car(2, "b2", -4.0, 5.0)) == AGAIN.get(gate, "")
    assert scene.show(car(3, "c2", 1.9)) == "Go 3"


@EVERY_GATE
def test_a_vehicle_that_lost_its_right_of_way_and_looks_committed_is_waited_for(gate: str) -> None:
    """No wake-up comes when it stands, so the session asks to look again every step."""
    scene = Scene(Dim(gate=gate))
    scene.show(car(3, "c2", 2.2))
    scene.show(car(3, "c2", 1.3, 1.0), car(2, "b2", 8.0, 4.8))
    assert scene.show(car(3, "c2", 0.2, 0.9)) == "Wake 3.1"
    assert scene.show(car(3, "c2", 0.05)) == "Go 3"


def test_vehicles_out_of_sight_are_forgotten() -> None:
    scene = Scene(Dim())
    for vehicle in range(50):
        assert scene.show(car(vehicle, "a1", 3.0)) == f"Go {vehicle}"
        assert len(scene.session._agents) == 1
    scene.show()
    assert not scene.session._agents


def test_sessions_share_nothing_but_the_table() -> None:
    dim, site = Dim(), four_way().site()
    one, other = Scene(dim, site), Scene(dim, site)
    assert one.show(car(1, "a1", 3.0)) == "Go 1"
    assert other.show(car(1, "a1", 3.0)) == "Go 1"
    assert one.session.rules.table is other.session.rules.table


@dataclass(frozen=True)
class Blind:
    """Each vehicle sees only itself."""

    name = "blind"
    period = None

    def start(self, site: Site) -> See:
        return lambda view, ego: View(view.time, (ego,))


def test_each_vehicle_decides_from_what_it_perceives_itself() -> None:
    waiting = [car(i, m, 2.2) for i, m in enumerate(["a2", "b2", "c2", "d2"])]
    assert Scene(Dim(perception=Blind())).show(*waiting) == "Go 0, Go 1, Go 2, Go 3"


def test_the_plan() -> None:
    zones = Zones(red=20, yellow=5, green=3)
    site = four_way().site()
    plan = Dim(zones=zones).start(site).plan
    assert plan.hold_distance == 3
    assert plan.sight == 8.5
    assert plan.wake_on_clear
    assert not plan.lanes_open
    assert plan.period is None
    assert plan.markings == zones.markings(site)
    assert Dim(period=0.1).start(site).plan.period == 0.1


@EVERY_GATE
@pytest.mark.parametrize("commit", COMMITS)
def test_wake_up_marks(gate: str, commit: str) -> None:
    """Yellow zone; half of the green zone, where the paper commits; entry, for the followers."""
    dim = Dim(zones=Zones(yellow=5, green=4), gate=gate, commit=commit)
    marks = (9, *[2] * (commit == "paper"), *[0] * (gate != "clear"))
    assert dim.start(four_way().site()).plan.marks == marks


def test_it_is_a_value() -> None:
    dim = Dim(matrix=HarmonyMatrix.paper(4), priorities=[3, 1, 0, 2])  # type: ignore[arg-type]
    assert dim.priorities == (3, 1, 0, 2)
    again = pickle.loads(pickle.dumps(dim))
    assert (again, hash(again), repr(again)) == (dim, hash(dim), repr(dim))


def test_lanes_by_inflow() -> None:
    dim = Dim(priorities="inflow")
    for split, ranks in [
        (None, (0, 1, 2, 3)),
        ((4, 1, 4, 1), (0, 2, 1, 3)),  # ties by lane
        ((1, 2, 3, 4), (3, 2, 1, 0)),
        ((3, 1, 4, 2), (1, 3, 0, 2)),
    ]:
        site = four_way(split=split).site()
        assert dim.ranks(site) == ranks
        assert dim.start(site).rules.table.priorities == ranks


def test_the_matrix_comes_from_the_site_unless_given() -> None:
    for maker, n in [(three_way, 3), (four_way, 4), (five_way, 5)]:
        assert Dim().harmony(maker().site()) == HarmonyMatrix.paper(n)
    right = Intersection((0.0, 90.0, 180.0, 270.0), side="right")
    site = Site(right, four_way().site().vehicle, 11.0, (1.0,) * 4)
    assert Dim().harmony(site) != HarmonyMatrix.paper(4)
    given = Dim(matrix=HarmonyMatrix.paper(4))
    assert given.start(site).rules.table.matrix == HarmonyMatrix.paper(4)


def test_sites_that_it_cannot_serve() -> None:
    site = five_way().site()
    with pytest.raises(InputError, match="matrix is for 4 arms, the intersection has 5"):
        Dim(matrix=HarmonyMatrix.paper(4)).start(site)
    with pytest.raises(InputError, match="priorities of 5 lanes"):
        Dim(priorities=(0, 1, 2)).start(site)
    with pytest.raises(InputError, match=r"; arm_length .* must be at least"):
        Dim().start(four_way(arm_length=40.0).site())
    with pytest.raises(InputError, match="site must be a Site"):
        Dim().start("four-way")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("priorities", "message"),
    [
        ("inflows", r"unknown priorities 'inflows'.*did you mean 'inflow'"),
        ((0, 2), "priorities of 2 lanes are the ranks 0 … 1"),
        (3, "priorities must be a sequence of ranks .*, got 3"),
        ((0, 10**5000), "priorities of 2 lanes"),
    ],
)
def test_priorities_are_checked(priorities: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Dim(priorities=priorities)  # type: ignore[arg-type]


def test_harmony_by_the_bodies_that_take_part() -> None:
    """Two turns that buses cannot take together, but motorcycles can."""
    site = four_way(fleet="motorcycle:0.5,bus:0.5", lane_width=3.5).site()
    worst, own = (Dim(bodies=bodies).start(site) for bodies in ("worst", "own"))
    small = worst.rules.table.matrix
    pairs = np.argwhere(own.rules.table.matrix.values[:12, :12] & ~small.values).tolist()
    first, second = (small.movements[k] for k in pairs[0])
    for kind, several in ((0, True), (1, False)):
        both = [car(k, str(m), 8.0)._replace(type=kind) for k, m in enumerate((first, second))]
        going = [c for c in Dim(bodies="own").start(site).decide(view(*both)) if isinstance(c, Go)]
        assert len(going) == 1 + several
        going = [c for c in Dim().start(site).decide(view(*both)) if isinstance(c, Go)]
        assert len(going) == 1


def test_one_type_needs_no_matrix_by_type_and_a_given_one_is_for_no_types() -> None:
    site = four_way().site()
    assert Dim(bodies="own").start(site).rules.table is Dim().start(site).rules.table
    with pytest.raises(InputError, match="bodies has an effect only with matrix=none"):
        Dim(matrix=HarmonyMatrix.paper(4), bodies="own")
    fleet = four_way(fleet="car:0.5,bus:0.5", lane_width=3.5).site()
    typed = HarmonyMatrix.from_geometry(fleet.intersection, fleet.fleet, by_type=True)
    with pytest.raises(InputError, match="say bodies=own"):
        Dim(matrix=typed).start(fleet)
