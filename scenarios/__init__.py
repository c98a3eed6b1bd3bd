"""What is simulated: scenarios, profiles, experiments and the command line."""

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
