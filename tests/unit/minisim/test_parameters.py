"""Declared parameters: one declaration gives default, check, message and help."""

from __future__ import annotations

import dataclasses
import pickle
from typing import Any

import pytest

from minisim.errors import InputError
from minisim.parameters import (
    checked,
    declared,
    parameters,
    part,
    real,
    reals,
    refuse_idle,
    switch,
    text,
    whole,
    word,
)


def even(title: str, value: Any) -> int:
    if value % 2:
        raise InputError(f"{title} must be even, got {value}")
    return int(value)


@declared
class Wheel:
    """A wheel."""

    radius: float = real("from hub to rim", "m", low=0, above=0, high=2)
    spokes: int = whole("number of them", low=3, high=40, default=32)


@declared(kw_only=True)
class Bicycle:
    """A bicycle."""

    gear: str = word("which gear", ("low", "high"), default="low", label="gear name")
    bell: bool = switch("whether it has one", default=True)
    owner: str = text("its rider", empty=True, default="")
    load: float | None = real("what it carries", "kg", low=0, optional=True, default=None)
    stops: tuple[float, ...] = reals("where it stops", "m", low=0, default=())
    front: Wheel = part("the front wheel", Wheel, kinds={"small": Wheel}, default=Wheel(0.3))
    pedals: int = checked("number of them", even, "even number", default=2)

    def __post_init__(self) -> None:
        if self.gear == "high" and self.load:
            raise InputError("a loaded bicycle needs the low gear")


def test_a_declared_class_is_a_frozen_dataclass() -> None:
    wheel = Wheel(0.3, spokes=20)
    assert wheel == dataclasses.replace(Wheel(0.3), spokes=20)
    assert hash(wheel) == hash(Wheel(0.3, 20))
    assert pickle.loads(pickle.dumps(wheel)) == wheel
    with pytest.raises(dataclasses.FrozenInstanceError):
        wheel.spokes = 3  # type: ignore[misc]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"gear": "hig"}, "unknown gear name 'hig'; allowed: low, high; did you mean 'high'?"),
        ({"bell": 1}, "bell must be true or false, got 1"),
        ({"owner": 3}, "owner must be a text, got 3"),
        ({"load": -1}, "load [kg] must be at least 0, got -1"),
        ({"stops": [1, -2]}, "stops [m][1] must be at least 0, got -2.0"),
        ({"stops": 3}, "stops [m] must be a sequence of numbers, got 3"),
        ({"front": Wheel}, "front must be small or a Wheel, got <class "),
        ({"pedals": 3}, "pedals must be even, got 3"),
        ({"gear": "high", "load": 5}, "a loaded bicycle needs the low gear"),
    ],
)
def test_what_is_not_allowed_is_one_sentence(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as error:
        Bicycle(**given)
    assert str(error.value).startswith(message)


def test_values_are_kept_as_given_but_for_their_form() -> None:
    assert Bicycle(stops=[1, 2]).stops == (1.0, 2.0)
    assert repr(Wheel(1)) == "Wheel(radius=1, spokes=32)"
    assert Bicycle(load=None).load is None


def test_parameters_tell_what_was_declared() -> None:
    radius, spokes = parameters(Wheel)
    assert (radius.name, radius.parameter.unit) == ("radius", "m")
    assert radius.default is dataclasses.MISSING
    assert (spokes.parameter.allowed, spokes.default) == ("integer 3 … 40", 32)
    by_name = {it.name: it.parameter for it in parameters(Bicycle)}
    assert by_name["gear"].words == ("low", "high")
    assert by_name["load"].allowed == "≥ 0 | none"
    assert by_name["front"].kinds == {"small": Wheel}
    assert parameters(int) == ()


def test_the_docstring_lists_them() -> None:
    assert Wheel.__doc__ == (
        "A wheel.\n\nParameters:\n"
        "    radius: from hub to rim [m] (> 0, ≤ 2).\n"
        "    spokes: number of them (integer 3 … 40); 32 by default."
    )
    assert "the front wheel (small(radius)); Wheel(…) by default." in (Bicycle.__doc__ or "")


def test_a_subclass_may_declare_a_field_anew() -> None:
    @declared
    class Tiny(Wheel):
        """A wheel of a toy."""

        radius: float = real("from hub to rim", "m", above=0, high=0.01, default=0.005)

    assert Tiny().radius == 0.005
    with pytest.raises(InputError, match=r"at most 0\.01"):
        Tiny(1.0)


def test_a_subclass_keeps_the_rules_between_fields() -> None:
    @declared(kw_only=True)
    class Tandem(Bicycle):
        """For two."""

        seats: int = whole("number of them", low=2, default=2)

    with pytest.raises(InputError, match="needs the low gear"):
        Tandem(gear="high", load=3)
    with pytest.raises(InputError, match="seats must be an integer of at least 2"):
        Tandem(seats=1)


def test_arguments_that_a_class_does_not_take_are_one_sentence() -> None:
    wheel: Any = Wheel
    known = "unknown Wheel parameter 'radus'; allowed: radius, spokes; did you mean 'radius'"
    with pytest.raises(InputError, match=known):
        wheel(radus=1)
    with pytest.raises(InputError, match="Wheel needs radius"):
        wheel()
    with pytest.raises(InputError, match="too many positional"):
        wheel(1, 3, 3)


def test_values_may_be_written_as_on_command_lines() -> None:
    written: dict[str, Any] = {
        "front": "small(radius=0.5,spokes=20)", "bell": "OFF", "load": "none",
    }  # fmt: skip
    assert Bicycle(**written) == Bicycle(front=Wheel(0.5, 20), bell=False)
    table: Any = {"radius": 0.5}
    assert Bicycle(front=table).front == Wheel(0.5)
    written = {"front": "small"}
    with pytest.raises(InputError, match=r"=small needs radius; write front=small\(radius=…\)"):
        Bicycle(**written)


def test_a_parameter_without_effect_is_refused() -> None:
    refuse_idle(Bicycle(bell=False), "a mirror", "load", "gear")
    with pytest.raises(InputError, match="load has an effect only with a mirror; leave it out"):
        refuse_idle(Bicycle(load=3), "a mirror", "load", "gear")
