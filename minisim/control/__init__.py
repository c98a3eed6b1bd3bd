"""What a controller sees and may command: the door between the simulator and the controllers.

Controllers may also import `junction`, `vehicle`, `fleet`, `parameters`, `names`, `errors`,
`files`, `streams`, `inflow`, `laws`, `carfollowing` and `jit` from `minisim`. None of these imports
the engine, the hosts or the results; `make lint` checks this.

A `Controller` is a frozen recipe. For each run the host (minisim, or SUMO) calls
`controller.start(site)` and gets a `Session`: the mutable side, with a `Plan` of what it needs.
The host then advances alone until one of the plan's wake-ups, shows the session a `View`, and
carries out the commands that the session returns. Only a plan with a period wakes it regularly.
"""

from __future__ import annotations

from minisim.control.commands import (
    TO_LANES,
    TO_VEHICLES,
    Accelerate,
    Advise,
    Brake,
    Close,
    Command,
    Go,
    Hold,
    Open,
    Reserve,
    Wake,
    check_command,
)
from minisim.control.cover import NOTHING, ORDINARY, Cover, cover_of
from minisim.control.plan import Marking, Plan
from minisim.control.protocols import Controller, Counting, Kinds, Session, as_controller, keeps
from minisim.control.radio import Radio
from minisim.control.silent import External, Unregulated
from minisim.control.site import LATERAL_ACCELERATION, Site
from minisim.control.view import (
    AT_LINE,
    COMMIT_MARGIN,
    HALTING,
    NO_REPORTS,
    SUMO_AT_LINE,
    Observed,
    Report,
    View,
    can_stop,
    stopping_distance,
)

__all__ = [
    "AT_LINE",
    "COMMIT_MARGIN",
    "HALTING",
    "LATERAL_ACCELERATION",
    "NOTHING",
    "NO_REPORTS",
    "ORDINARY",
    "SUMO_AT_LINE",
    "TO_LANES",
    "TO_VEHICLES",
    "Accelerate",
    "Advise",
    "Brake",
    "Close",
    "Command",
    "Controller",
    "Counting",
    "Cover",
    "External",
    "Go",
    "Hold",
    "Kinds",
    "Marking",
    "Observed",
    "Open",
    "Plan",
    "Radio",
    "Report",
    "Reserve",
    "Session",
    "Site",
    "Unregulated",
    "View",
    "Wake",
    "as_controller",
    "can_stop",
    "check_command",
    "cover_of",
    "keeps",
    "stopping_distance",
]
