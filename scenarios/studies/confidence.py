"""Misread intents when vehicles believe only readings above some confidence."""

from __future__ import annotations

from itertools import product

from dim.senses.intent import KINDS
from dim.senses.noise import CLASSIFIER
from scenarios.studies.shared.intent_errors import FEW, IntentErrorPoint
from scenarios.studies.shared.study import Study

#: Confidence thresholds; at 0, every reading is believed.
THRESHOLDS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99)

STUDY = Study(
    "confidence",
    "What does it cost to believe only confident readings?",
    # Lanes first, since unknown intents block a junction where the largest clique goes first.
    tuple(
        IntentErrorPoint("dim:order=lanes", kind, CLASSIFIER, confidence=threshold)
        for kind, threshold in product(KINDS, THRESHOLDS)
    ),
    FEW,
    about_collisions=True,
)
