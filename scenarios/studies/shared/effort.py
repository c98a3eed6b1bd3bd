"""How much is simulated for studies."""

from __future__ import annotations

from typing import Any

from minisim.errors import InputError, integer, show
from minisim.parameters import MaybeReals, checked, declared, part, real, reals, whole


def _power_of_two(title: str, value: Any) -> int:
    steps = integer(title, value, low=2)
    if steps.bit_count() != 1:
        raise InputError(f"{title} must be a power of two, got {show(steps)}")
    return steps


@declared(kw_only=True)
class Search:
    """How to search for a limit: by bisection, with `seeds` · log₂(`steps`) runs per point."""

    step: float = real("demands are multiples of it", "veh/h", above=0, default=10.0)
    steps: int = checked("highest demand, in `step`s", _power_of_two, "power of two", default=128)
    seeds: int = whole("each has a bisection of its own; the seeds 1 … `seeds`", low=1, default=4)
    horizon: float = real("of each run", "s", above=0, default=3600.0)

    @property
    def rounds(self) -> int:
        """How many times a bisection halves its bracket."""
        return self.steps.bit_length() - 1


@declared(kw_only=True)
class Effort:
    """How much is simulated for each study."""

    seeds: int = whole("runs per point; the seeds 1 … `seeds`", low=2, high=10_000, default=10)
    horizon: float = real("of each run", "s", above=0, default=3600.0)
    densities: MaybeReals[tuple[float, ...]] = reals(
        "only points with these demands, in studies that have them; none means all",
        "veh/h/lane", optional=True, label="densities", default=None,
    )  # fmt: skip
    search: Search = part("for studies that search", Search, default_factory=Search)

    @classmethod
    def of(cls, *, quick: bool = False, seeds: int | None = None) -> Effort:
        """The full effort, or a smoke test at two demands. `seeds` replaces the number of seeds."""
        if not quick:
            return cls() if seeds is None else cls(seeds=seeds)
        search = Search(step=200.0, steps=4, seeds=2, horizon=150.0)
        densities = (150.0, 350.0)
        seeds = 2 if seeds is None else seeds
        return cls(seeds=seeds, horizon=150.0, densities=densities, search=search)

    @property
    def warning(self) -> str:
        """A warning before the numbers of a smoke test; empty otherwise."""
        return "" if self.densities is None else "A smoke test: its numbers mean nothing. "

    def command(self, *names: str) -> str:
        """The command line that makes the runs of these studies."""
        only = "".join(f" --only {name}" for name in names)
        quick = " --quick" if self.densities is not None else ""
        return f"minisim reproduce{only}{quick} --seeds {self.seeds}"
