"""What DIM is compared with: controllers that need infrastructure or a fixed rule."""

from baselines.fixed_time import FixedTime
from baselines.webster import SignalTiming, webster, webster_delay

__all__ = ["FixedTime", "SignalTiming", "webster", "webster_delay"]
