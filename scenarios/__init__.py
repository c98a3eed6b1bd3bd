"""What is simulated: scenarios and profiles here; sweeps, studies and the command line within."""

from scenarios.library import five_way, four_way, from_bearings, regular, three_way
from scenarios.scenario import AS_RUN, FAIR, PAPER, PROFILES, Profile, Scenario

__all__ = [
    "AS_RUN",
    "FAIR",
    "PAPER",
    "PROFILES",
    "Profile",
    "Scenario",
    "five_way",
    "four_way",
    "from_bearings",
    "regular",
    "three_way",
]
