"""How many examples a costly property gets."""

from __future__ import annotations

from hypothesis import settings


def share(part: float) -> settings:
    """Decorator: only this share of the profile's examples, for costly properties."""
    return settings(max_examples=max(1, round(part * settings().max_examples)))
