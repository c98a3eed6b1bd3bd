"""What counts as a session, and as what kind of it."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

from minisim.control import (
    Controller,
    Counting,
    Kinds,
    Plan,
    Session,
    Site,
    Unregulated,
    keeps,
)
from minisim.junction.geometry import Intersection
from minisim.vehicle import VehicleType

FOUR = Intersection((0.0, 90.0, 180.0, 270.0))
SITE = Site(FOUR, VehicleType(), speed_limit=14.0, demand=(350.0,) * 4)


def test_keeps_agrees_with_isinstance() -> None:
    """Members may be of the class or of the object; a method that is None is none."""

    class Own:
        def __init__(self, **members: Any) -> None:
            vars(self).update(members)

    def call(*_: Any) -> list[Any]:
        return []

    values = [
        Unregulated(), Unregulated().start(SITE), Own(), Own(plan=None, decide=call), Unregulated,
        Own(plan=Plan(), decide=None), Own(name=None, start=call), Own(start=call), None, 3,
        Own(plan=Plan(), decide=call, counts={}), Own(plan=Plan(), decide=call, kind=call),
    ]  # fmt: skip
    for protocol in (Controller, Session, Counting, Kinds):
        kept = [keeps(value, protocol) for value in values]
        assert kept == [isinstance(value, protocol) for value in values]
        assert 0 < sum(kept) < len(values)


@runtime_checkable
class Steering(Session, Protocol):
    """A protocol of another module than those of `minisim.control`."""

    def steer(self) -> None: ...


def test_keeps_knows_protocols_of_any_module() -> None:
    """It once asked for the members of its own module only, so any session would have passed."""
    assert not keeps(Unregulated().start(SITE), Steering)
