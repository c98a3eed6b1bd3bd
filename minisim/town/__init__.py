"""Junctions of real towns: networks of SUMO and extracts of OpenStreetMap.

    from minisim.town import read_junction, survey

    read_junction("town.net.xml", node="252016277")  # an Intersection
    survey("town.net.xml")  # every node, and whether it can be simulated

Networks are read as they are; an extract of OpenStreetMap goes through netconvert first (extra
`sumo`). Bearings are from true north, also where the network's y axis is the north of a UTM grid,
which may be 3° off; other projections are taken as they are.
"""

from __future__ import annotations

from minisim.town.surveying import Survey, read_junction, survey, survey_of

__all__ = ["Survey", "read_junction", "survey", "survey_of"]
