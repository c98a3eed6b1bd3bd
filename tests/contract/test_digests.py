"""Runs stay what they were: the trips of a few, of the 605 that `tests/digests.py` compares."""

from __future__ import annotations

import pytest

from tests.digests import TRIPS, cases, digest, recipe_of

#: Case -> digest of its trips, from before the house was redesigned; those of the profiles as_run
#: and as_run_signals are from when minisim learnt to drive like SUMO 1.18.
KEPT = {
    "paper/4/dim/1": "74c7e874b97929f8",
    "paper/3/dim:commit=paper/2": "86dc123846e093ad",
    "fair/5/dim:gate=harmonious/1": "2add2105bf9184d4",
    "fair/4/dim:monitor=on/1": "5bee1055dff5ef79",
    "fair/4/dim:perception=noisy(intent_error=0.15,kind=symmetric)/2": "42157dd96eb2d084",
    "fair/4/dim/1 humans=0.3": "8321b50b1127102b",
    "paper/4/fixed-time/1": "4b5f8709f3fe553f",
    "fair/4/adaptive/2": "fb8fdbea82be9a26",
    "fair/3/actuated/1": "fd4a223affdcee3d",
    "fair/4/longest-queue/1": "42157977f50783fc",
    "paper/4/all-way-stop/1": "300bda961bc3197f",
    "fair/4/v2ic/1": "938779fadf79e5b5",
    "fair/5/reservation/2": "e034d4f26190ea2d",
    "as_run/4/dim/1": "b02cfed84a807104",
    "as_run/4/v2ic-as-run/1": "daf65ce632436dd1",
    "as_run_signals/4/fixed-time/1": "cfe79b624bf4eb30",
    "fair/4/dim/2 model=krauss": "8bc201e6349842b4",
    "fair/4/dim/1 model=iidm": "1cdcfbd7057a4c70",
    "fair/4/dim:gate=harmonious/1 side=right": "eecc861ccbbb55ae",
    "fair/4/v2ic/2 bearings=(0.0, 80.0, 190.0, 260.0)": "c00b10ac8de9bae6",
}
CASES = {str(case): case for case in cases()}


@pytest.mark.parametrize("name", KEPT)
def test_trips_are_what_they_were(name: str) -> None:
    assert digest(recipe_of(CASES[name]).run().trips, TRIPS) == KEPT[name]
