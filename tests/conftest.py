"""Hypothesis profiles for all tests: the same examples in every run and on every machine."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

# No deadline and no `too_slow`: compilation and a busy machine are no failures.
settings.register_profile(
    "ci",
    derandomize=True,
    deadline=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("thorough", settings.get_profile("ci"), max_examples=600)
settings.load_profile("ci")
