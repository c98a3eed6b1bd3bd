"""Turning-movement counts: sheets of what was counted at a junction, as a demand.

A sheet has a row per interval, approach and turn, with a column per class or with one column for
the class and one for the count; or a row per interval with a column per movement, such as `NBL`.
"""

from __future__ import annotations

from minisim.counts.counting import Count, read_counts

__all__ = ["Count", "read_counts"]
