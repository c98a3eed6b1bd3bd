"""For all tests: the same examples and the same stderr in every run and on every machine."""

from __future__ import annotations

import math

from hypothesis import HealthCheck, Phase, settings

from scenarios.cli.shared import terminal

# On a busy machine a command would print its progress on stderr.
terminal.SILENCE = math.inf

# No deadline and no `too_slow`: compilation and a busy machine are no failures.
settings.register_profile(
    "ci",
    derandomize=True,
    deadline=None,
    max_examples=50,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("thorough", settings.get_profile("ci"), max_examples=500)
# For `make mutants`: no one reads a mutant's counterexample, so it is not shrunk.
settings.register_profile(
    "mutants", settings.get_profile("ci"), max_examples=20, phases=[Phase.explicit, Phase.generate]
)
settings.load_profile("ci")
