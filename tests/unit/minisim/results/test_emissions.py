"""The polynomials of HBEFA 3.1 in SUMO; `tests/sumo/test_emissions.py` asks SUMO itself."""

from __future__ import annotations

import numpy as np
import pytest

from minisim.fleet import TYPES
from minisim.results.emissions import CLASSES, coasting, emission_class, rate


def test_rates_by_hand() -> None:
    car = CLASSES["PC_G_EU4"].co2
    speeds, accelerations = np.array([0.0, 10.0, 10.0, 10.0]), np.array([-2.0, 0.0, 1.0, -0.24])
    expected = [9449, 9449 - 4671 + 2826, 9449 + 9384 - 4671 + 2826, 0.0]
    assert rate(speeds, accelerations, car) * 3.6 == pytest.approx(expected)


def test_what_coasts_burns_nothing_but_what_idles_does() -> None:
    car = CLASSES["PC_G_EU4"].fuel
    for v in (0.6, 2.0, 10.0 / 3.6, 8.0, 20.0):
        at = coasting(np.array([v]))
        assert rate(np.array([v]), -at + 1e-6, car) > 0.0
        assert rate(np.array([v]), -at - 1e-6, car) == 0.0
    assert rate(np.array([0.5]), np.array([-1.0]), car) > 0.0
    assert coasting(np.array([1.0])) == pytest.approx(0.36 * coasting(np.array([10.0 / 3.6])))


def test_each_ready_type_has_a_class_or_none() -> None:
    classes = {name: emission_class(name) for name in TYPES}
    assert classes["car"] == classes["sumo-passenger"] == classes["car-offtracking"] == "PC_G_EU4"
    assert classes["sumo-coach"] == classes["bus"] == "Bus"
    assert classes["truck"] == classes["sumo-trailer"] == "HDV"
    assert {name for name, it in classes.items() if it is None} == {"motorcycle", "auto-rickshaw"}
    assert emission_class("my own car") is None
