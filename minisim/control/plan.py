"""What a session needs from its host: markings, wake-ups, and how far it sees."""

from __future__ import annotations

from minisim.errors import instance, number
from minisim.parameters import Reals, Switch, checked, declared, real, reals, switch, text


@declared
class Marking:
    """A stretch of approach lane, from `start` down to `end` metres before the junction entry."""

    name: str = text(
        'shown in figures ("red", "yellow", "green" are drawn in their colour)',
        label="name of a marking",
    )
    start: float = real("before the junction entry", "m", label="start of a marking")
    end: float = real("before the junction entry", "m", low=0, label="end of a marking")
    speed: float | None = real(
        "limit on it; a vehicle slows for it ahead of `start`", "m/s",
        default=None, above=0, high=100, optional=True, label="speed of a marking",
    )  # fmt: skip

    def __post_init__(self) -> None:
        number(f"start of marking {self.name} [m]", self.start, above=self.end)


def _markings(title: str, value: tuple[Marking, ...]) -> tuple[Marking, ...]:
    instance(title, value, tuple)
    for marking in value:
        instance("marking", marking, Marking)
    return value


@declared(kw_only=True)
class Plan:
    """What a session needs from its host."""

    hold_distance: float = real(
        "of the hold line from the junction entry", "m", default=0.0, low=0, high=1000
    )
    markings: tuple[Marking, ...] = checked("on every lane", _markings, "markings", default=())
    marks: Reals[tuple[float, ...]] = reals(
        "wake when a front bumper passes one of these distances before the junction entry; 0 is "
        "the entry itself, negative is past it",
        "m", default=(), low=-1000,
    )  # fmt: skip
    wake_on_clear: Switch = switch("wake when a rear bumper leaves the junction", default=False)
    wake_when_empty: Switch = switch(
        "marks and vehicles that leave wake only while no vehicle is inside the junction",
        default=False,
    )  # fmt: skip
    period: float | None = real(
        "wake at this interval, at least the step", "s", default=None, above=0, optional=True
    )
    sight: float = real(
        "how far before the junction entry a view reaches, on the road", "m", default=50.0, low=0
    )
    reach: float = real(
        "a view keeps a vehicle until its front is this far past the junction entry, even after "
        "its rear has left the junction",
        "m", default=0.0, low=0,
    )  # fmt: skip
    lanes_open: Switch = switch("lanes start open; otherwise vehicles are held", default=False)
