"""Many runs at once: files that describe them, what runs them, the store that keeps their rows."""

from scenarios.sweep.file import read_experiments
from scenarios.sweep.runner import sweep
from scenarios.sweep.store import Store

__all__ = ["Store", "read_experiments", "sweep"]
