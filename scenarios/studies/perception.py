"""Misread intents: probability, kind and manner of errors."""

from __future__ import annotations

from itertools import product

from dim.senses.intent import KINDS, RATES
from dim.senses.noise import CLASSIFIER
from scenarios.studies.shared.intent_errors import FEW, MANNERS, MISREADERS, IntentErrorPoint
from scenarios.studies.shared.study import Study

STUDY = Study(
    "perception",
    "What happens when vehicles misread each other's intent?",
    (
        *(IntentErrorPoint(series) for series in MISREADERS),
        *(
            IntentErrorPoint(series, kind, rate, shared, persistent)
            for series in MISREADERS[:2]
            for kind, (shared, persistent), rate in product(KINDS, MANNERS, RATES[1:])
        ),
        *(
            IntentErrorPoint(MISREADERS[2], kind, CLASSIFIER, shared, persistent)
            for kind, (shared, persistent) in product(KINDS, MANNERS)
        ),
        *(IntentErrorPoint(series, unsignalled=True) for series in MISREADERS),
    ),
    FEW,
    about_collisions=True,
)
