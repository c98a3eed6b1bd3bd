"""A recipe's spelling, read back, is the same recipe."""

from __future__ import annotations

import contextlib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from minisim.control import Controller
from minisim.errors import InputError
from minisim.names import spelled_value
from minisim.parameters import Parameter, parameters
from scenarios.controllers import CONTROLLERS, controller_named

#: Values that parameters may have: those that a check refuses are drawn again.
VALUES: st.SearchStrategy[Any] = (
    st.none()
    | st.booleans()
    | st.integers(-1, 200)
    | st.floats(-1, 200)
    | st.sampled_from([1e-7, 123456.7, 0.1 + 0.2, 1e22])
    | st.text(max_size=6)
    | st.sampled_from(["inflow", "waiting", "none", "True", "a b", "'", "lambda", "on", "acbd"])
    | st.permutations(range(4)).map(tuple)
    | st.lists(st.floats(0, 60), max_size=4).map(tuple)
)


def fits(parameter: Parameter, value: Any) -> bool:
    try:
        parameter.check("it", value)
    except InputError:
        return False
    return True


@st.composite
def recipes(draw: st.DrawFn, make: Any) -> Any:
    """Anything that a class makes of some of its parameters."""
    arguments: dict[str, Any] = {}
    for name, parameter, _ in parameters(make):
        if draw(st.booleans()):
            continue
        if parameter.kinds:
            kind = draw(st.sampled_from(sorted(parameter.kinds)))
            if parameters(parameter.kinds[kind]) or kind == "exact":
                arguments[name] = draw(recipes(parameter.kinds[kind]))
            elif kind == "paper":
                arguments[name] = parameter.kinds[kind](draw(st.sampled_from([3, 4, 5])))
        elif parameter.words and parameter.words != ("true", "false"):
            arguments[name] = draw(st.sampled_from(parameter.words))
        else:
            drawn = draw(st.lists(VALUES, max_size=5))
            arguments.update((name, one) for one in drawn if fits(parameter, one))
    kept: dict[str, Any] = {}
    for name, value in arguments.items():
        with contextlib.suppress(InputError):  # a rule between fields
            make(**kept, **{name: value})
            kept[name] = value
    return make(**kept)


@pytest.mark.parametrize("name", CONTROLLERS)
@given(data=st.data())
def test_reading_a_spelling_gives_the_same_recipe(name: str, data: st.DataObject) -> None:
    make = CONTROLLERS[name].make
    recipe: Controller = data.draw(recipes(make))
    again = controller_named(recipe.name)
    assert again == recipe
    assert again.name == recipe.name
    # Python takes what command lines do.
    values = {field: getattr(recipe, field) for field, _, _ in parameters(make)}
    written = {
        field: spelled_value(values[field], it.kinds)
        for field, it, default in parameters(make)
        if values[field] != default and (it.kinds or it.words)
    }
    assert make(**values | written) == recipe


@given(first=recipes(CONTROLLERS["dim"].make), second=recipes(CONTROLLERS["dim"].make))
def test_two_recipes_never_have_one_name(first: Controller, second: Controller) -> None:
    assert (first == second) == (first.name == second.name)


@given(text=st.text(max_size=30))
def test_any_text_is_a_controller_or_one_sentence(text: str) -> None:
    for spec in (text, f"dim:{text}", f"dim:gate={text}"):
        message = "made"
        try:
            controller_named(spec)
        except InputError as error:
            message = str(error)
        assert 0 < len(message) < 1000
