"""The road of an arm, where it differs from the junction's usual one."""

from __future__ import annotations

from minisim.parameters import declared, real, word

#: Directions in which a road may be driven.
DIRECTIONS = ("both", "in", "out")


@declared
class Road:
    """The road of one arm: one lane in and one lane out, or only one of the two.

    The two lanes of a road lie beside its axis; the only lane of a one-way road lies on it. A value
    of none means the junction's own, or for the limit the profile's.
    """

    length: float | None = real(
        "from the centre to its far end; none is the junction's arm_length",
        "m", low=20, high=20_000, optional=True, default=None,
    )  # fmt: skip
    speed_limit: float | None = real(
        "its limit, before the junction and after it; none is the profile's",
        "m/s", above=0, high=100, optional=True, default=None,
    )  # fmt: skip
    lane_width: float | None = real(
        "width of its lanes; none is the junction's", "m",
        low=2, high=6, optional=True, default=None,
    )  # fmt: skip
    traffic: str = word(
        "both ways, only into the junction, or only out of it", DIRECTIONS, default="both"
    )

    @property
    def one_way(self) -> bool:
        """Whether it has only one lane."""
        return self.traffic != "both"
