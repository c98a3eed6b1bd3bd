"""Vehicles under cruise control: the law of the published runs, SUMO's CC model.

Everything special about this law is in this folder: its leaders, what it remembers of each vehicle
and how it chooses accelerations. The kernel calls `accelerate` in place of its own, and `look`
after every step. The equations are in `minisim.carfollowing`.

A vehicle obeys the hardest braking that any of its leaders asks for
(`MSVehicle::planMoveInternal`, with the model's radar). The leaders are:

- the vehicle ahead on its own stretch of road (approach, way through the junction, exit);
- the last vehicle on every later stretch, from any lane and at any distance;
- vehicles inside the junction whose ways meet its own (`minisim.junction.meetings`), once it is
  inside too: those that were there before it, or that stand in the way (`meet`);
- the radar's leader: the first vehicle on its own lane, way or exit; but a vehicle inside the
  junction that meets its way comes before those on stretches behind (`radar`).

What the radar sees is the one quirk in which SUMO's versions differ, and the published runs depend
on it (`CruiseVehicle.sumo`). In 1.18 it also sees vehicles that only cross, those from its own lane
that turn off elsewhere, and those that wait inside the junction with priority; one with no room
left counts as if bumper to bumper. Since then it sees only those bound for the same exit; one with
no room left counts as at the beginning of the part of the way that others can meet.
"""
