"""Misread intents, over the confidence below which a reading is not believed."""

from __future__ import annotations

from itertools import product

from dim.senses.intent import KINDS
from dim.senses.noise import CLASSIFIER
from scenarios.studies.shared.intent_errors import FEW, IntentErrorPoint
from scenarios.studies.shared.study import Study

#: Thresholds of confidence; 0 takes every reading as it is.
THRESHOLDS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99)

STUDY = Study(
    "confidence",
    "What does it cost to believe only readings that are sure?",
    # Lanes first: with the largest clique first, unknown intents block the junction.
    tuple(
        IntentErrorPoint("dim:order=lanes", kind, CLASSIFIER, confidence=threshold)
        for kind, threshold in product(KINDS, THRESHOLDS)
    ),
    FEW,
    about_collisions=True,
)
