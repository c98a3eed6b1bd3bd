"""The validators: what they let through and what their messages say."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from minisim import errors
from minisim.errors import InputError, MinisimError


@pytest.mark.parametrize("value", [0, 2.5, np.float64(2.5), np.int64(3), Fraction(5, 2)])
def test_number_accepts_every_kind_of_real_number(value: float) -> None:
    result = errors.number("x", value, low=0, high=3)
    assert type(result) is float
    assert result == value


@pytest.mark.parametrize(
    "value", [True, "2", None, 2j, math.nan, math.inf, 10**400, [1], np.array(1.0)]
)
def test_number_refuses_what_is_not_a_finite_real_number(value: object) -> None:
    with pytest.raises(InputError, match=r"^x "):
        errors.number("x", value)


def test_number_distinguishes_closed_and_open_bounds() -> None:
    assert errors.number("x", 1, low=1, high=1) == 1.0
    with pytest.raises(InputError, match=r"x must be above 1, got 1$"):
        errors.number("x", 1, above=1)
    with pytest.raises(InputError, match=r"x must be below 1, got 1$"):
        errors.number("x", 1, below=1)
    with pytest.raises(InputError, match=r"speed must be at least 0 and at most 9, got 9\.5"):
        errors.number("speed", 9.5, low=0, high=9)
    with pytest.raises(InputError, match=r"^x must be a finite number, got inf$"):
        errors.number("x", math.inf, above=0)


@pytest.mark.parametrize("value", [1.0, True, "1", None, 0, 6, np.float64(2)])
def test_integer_refuses_other_types_and_values_out_of_range(value: object) -> None:
    with pytest.raises(InputError, match="an integer 1 … 5"):
        errors.integer("x", value, low=1, high=5)
    assert type(errors.integer("x", np.uint8(5), low=1)) is int


def test_choice_names_the_nearest_allowed_value_if_one_is_near() -> None:
    assert errors.choice("profile", "fair", ["paper", "fair"]) == "fair"
    for value, hint in (("papper", "; did you mean 'paper'?"), (None, ""), (3, ""), ("zzz", "")):
        with pytest.raises(InputError) as caught:
            errors.choice("profile", value, ["paper", "fair"])
        assert str(caught.value) == f"unknown profile {value!r}; allowed: paper, fair{hint}"


def test_numbers_reads_any_sequence_and_names_the_broken_item() -> None:
    assert errors.numbers("split", np.array([4, 3])) == (4.0, 3.0)
    with pytest.raises(InputError, match=r"split\[1\] must be a number, got 'x'"):
        errors.numbers("split", [1, "x"])
    for value in ("12", b"12", 7, None, np.array(7.0)):
        with pytest.raises(InputError, match="must be a sequence of numbers"):
            errors.numbers("split", value)


def test_instance_names_what_is_wanted() -> None:
    errors.instance("path", "x", (str, bytes))
    with pytest.raises(InputError, match="path must be a text or a bytes, got 3"):
        errors.instance("path", 3, (str, bytes))
    with pytest.raises(InputError, match=r"^x must be an Exception, got 1$"):
        errors.instance("x", 1, Exception)


def test_messages_stay_short_and_survive_unprintable_integers() -> None:
    with pytest.raises(InputError, match="a int too large to print"):
        errors.integer("seed", 10**5000, low=0, high=9)
    with pytest.raises(InputError) as caught:
        errors.number("x", "y" * 10_000)
    assert len(str(caught.value)) < 300


def test_every_error_is_a_minisim_error_and_bad_input_a_value_error() -> None:
    kinds = [k for k in vars(errors).values() if isinstance(k, type) and issubclass(k, Exception)]
    assert len(kinds) >= 6
    assert all(issubclass(kind, MinisimError) for kind in kinds)
    assert issubclass(InputError, ValueError)


def test_things_agree_with_their_number() -> None:
    assert [errors.plural(k, "run") for k in (0, 1, 2)] == ["0 runs", "1 run", "2 runs"]
    assert errors.plural(1, "process", "processes") == "1 process"
    assert errors.plural(3, "process", "processes") == "3 processes"
