"""Runs stay what they were: the trips of a few, of the 629 that `tests/digests.py` compares."""

from __future__ import annotations

import pytest

from tests.digests import TRIPS, cases, digest, recipe_of

#: Case -> digest of its trips, from when arrivals were first drawn by lane. On the arrivals of
#: before, the trips were what they had been before the house was redesigned, but for the profiles
#: as_run and as_run_signals. Five with "dim" or "v2ic" changed once more, when advice and
#: holding close to the line no longer made vehicles brake beyond comfort.
KEPT = {
    "paper/4/dim/1": "d0c30b1365c30c9c",
    "paper/3/dim:commit=paper/2": "f133d9aee747f0a2",
    "fair/5/dim:gate=harmonious/1": "ee74c8b9037de956",
    "fair/4/dim:monitor=on/1": "d94a2f41a4737c90",
    "fair/4/dim:perception=noisy(intent_error=0.15,kind=symmetric)/2": "814c130165be4ce4",
    "fair/4/dim/1 humans=0.3": "4b68170ebeeea4f2",
    "paper/4/fixed-time/1": "2ecea1096805f85d",
    "fair/4/fixed-time:facing=true/1": "52b1e904a1bebe46",
    "fair/4/adaptive/2": "abc0c33341f21f73",
    "fair/3/actuated/1": "effec0198d6afa5c",
    "fair/4/max-pressure/1": "75fec4a79f90e06c",
    "fair/5/max-pressure:facing=true/1": "d722a9cdeddd5753",
    "paper/4/all-way-stop/1": "f1aaaa3887c49665",
    "fair/4/v2ic/1": "08e72b0a24bc7928",
    "fair/5/reservation/2": "2d1ce58f6f1556e6",
    "fair/4/slots/1": "8b7077b141b78dbd",
    "paper/3/platoons/2": "f0fb37defa938a68",
    "as_run/4/dim/1": "25bba17c88569873",
    "as_run/4/v2ic-as-run/1": "5640e6dfdec90219",
    "as_run_signals/4/fixed-time/1": "3b58a9120ba587b6",
    "fair/4/dim/2 model=krauss": "fd5f33336042bc1f",
    "fair/4/dim/1 model=iidm": "e3b9799c17b33ec2",
    "fair/4/dim:gate=harmonious/1 side=right": "27fc7ed105d9aac7",
    "fair/4/v2ic/2 bearings=(0.0, 80.0, 190.0, 260.0)": "8fd285edf2b9af3c",
}
CASES = {str(case): case for case in cases()}


@pytest.mark.parametrize("name", KEPT)
def test_trips_are_what_they_were(name: str) -> None:
    assert digest(recipe_of(CASES[name]).run().trips, TRIPS) == KEPT[name]
