"""Many runs at once: experiments, who runs them, and the store that keeps their rows."""

from scenarios.sweep.experiment import Experiment
from scenarios.sweep.file import read_experiments
from scenarios.sweep.runner import sweep
from scenarios.sweep.store import Store

__all__ = ["Experiment", "Store", "read_experiments", "sweep"]
