"""Right of way by messages that come late or never: what vehicles and a controller do about it.

It works for every controller with a `radio`, in every host. Messages go through a `Channel`:

- From `Plan.sight` on, a vehicle says where it is, how fast, what it was told last, and whether it
  has the right of way: every `Radio.interval`, until the controller confirms that it has left.
- The controller knows no more than that. It sees a vehicle where it last said that it was, once it
  has heard from all ahead of it in its lane, and until it has heard that it has left.
- One message tells a vehicle all that it shall do: right of way, speed, brakes. It has a number,
  and is repeated every interval until the vehicle names that number. Vehicles do what the highest
  number says. Until told, they stop at their hold lines.

Safety, after Dresner and Stone (JAIR 31 (2008), section 2: a lost message may cost time, but must
not cause a collision). A vehicle *may hold* the right of way from the first message that gives it
until it has left, or has said that it gave it up. Right of way is given only while no vehicle in
conflict may hold it, whatever the controller commands, so no loss or delay lets two in conflict go
at once. A vehicle that is told to stop and no longer can keeps its right of way, and says so. In
each lane, right of way is given from front to back, so those that hold it can leave, and others get
their turn.

A `Reserve` does not wait for vehicles in conflict: the session answers for it, since it knows when
the vehicle will be where. It takes effect at a time that both know (all clocks are right), and is
void if it comes later. Until then it is repeated every interval without waiting for an answer, as
warnings between vehicles are (DENM: ETSI EN 302 637-3, repetition interval and duration).

Lights (`Open`, `Close`) are seen, not sent.
"""

from minisim.link.session import Link as Link
from minisim.link.session import Linked as Linked
from minisim.link.session import radio_of as radio_of
