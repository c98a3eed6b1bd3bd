"""Names of recipes, as on command lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from minisim.names import name_of, spelled
from tests.unit.minisim.test_parameters import Bicycle, Wheel


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ({}, "bike"),
        ({"load": 5.0, "bell": False}, "bike:bell=false,load=5"),
        ({"bell": True, "pedals": 2}, "bike"),
        ({"load": 0.1 + 0.2}, "bike:load=0.30000000000000004"),
        ({"owner": "ann"}, "bike:owner=ann"),
        ({"owner": "ann b"}, "bike:owner='ann b'"),
        ({"owner": "None"}, "bike:owner='None'"),
        ({"owner": "class"}, "bike:owner='class'"),
        ({"stops": [1]}, "bike:stops=(1,)"),
        ({"stops": (1, 2.5)}, "bike:stops=(1,2.5)"),
        ({"front": Wheel(0.3)}, "bike"),
        ({"front": Wheel(0.5, 20)}, "bike:front=small(radius=0.5,spokes=20)"),
    ],
)
def test_a_spelling_has_what_differs(given: dict[str, Any], name: str) -> None:
    assert spelled("bike", Bicycle(**given)) == name


def test_a_value_without_a_text_is_a_digest() -> None:
    class Other(Wheel):
        """No word for it."""

    first, second = (spelled("bike", Bicycle(front=Other(radius))) for radius in (0.1, 0.2))
    assert first.startswith("bike:front=Other#")
    assert first != second == spelled("bike", Bicycle(front=Other(0.2)))


@dataclass(frozen=True)
class Constant:
    k: float = 1.0
    parts: tuple[int, ...] = ()
    name = "dc"


@dataclass(frozen=True)
class Labelled:
    k: float = 1.0
    name: str = "dc"


class Plain:
    name = "plain"


@pytest.mark.parametrize(
    ("controller", "name"),
    [
        (Constant(), "dc"),
        (Constant(k=3), "dc:k=3"),
        (Constant(3, (1, 2)), "dc:k=3,parts=(1,2)"),
        (Labelled(k=3), "dc:k=3"),
        (Labelled(k=3, name="mine"), "mine"),
        (Plain(), "plain"),
    ],
)
def test_a_constant_name_gets_the_parameters(controller: Any, name: str) -> None:
    assert name_of(controller) == name
