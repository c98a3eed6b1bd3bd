"""How large and how frequent the messages of vehicles and a controller are."""

from __future__ import annotations

from minisim.parameters import declared, real, whole


@declared
class Radio:
    """The messages that vehicles and a controller send each other.

    If none fails, a vehicle sends one for each view that shows it, and a controller one for each
    command to a vehicle. If some fail, `minisim.link` says which messages are sent.
    """

    # The smaller and more frequent of the two messages by which 3GPP compares radio links between
    # vehicles (TR 36.885, release 14, annex A.1.5, periodic traffic).
    state: int = whole("where a vehicle is and how fast, in bytes", default=190, low=1)
    command: int = whole("what it shall do, in bytes", default=190, low=1)
    # There, too: 10 messages per second, the most for which 3GPP TS 22.185 asks.
    interval: float = real(
        "from a message to the next one, if messages fail", "s", low=0.01, high=10, default=0.1
    )
