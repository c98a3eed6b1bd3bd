"""The words of count sheets for columns, classes of vehicles, turns and points of the compass."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

#: What a column may mean -> its usual names, in plain letters (`plain`). Times decide what "from"
#: and "to" mean: an interval, or the arms of a movement.
COLUMNS: Final[Mapping[str, tuple[str, ...]]] = {
    "start": (
        "start", "intervallstart", "starttime", "begin", "beginn", "time", "timestart", "zeit",
        "uhrzeit", "interval", "intervall", "period", "timeperiod", "zeitvon", "uhrzeitvon",
        "vonuhrzeit", "timefrom", "fromtime", "zeitraum", "from", "von",
    ),
    "end": (
        "end", "intervallende", "endtime", "ende", "timeend", "zeitbis", "uhrzeitbis", "bisuhrzeit",
        "timeto", "totime", "until", "bis", "to",
    ),
    "approach": ("approach", "zufahrt", "arm", "knotenarm", "leg", "from", "origin", "von"),
    "turn": ("turn", "turning", "movement", "kennung", "manoeuvre", "maneuver", "richtung"),
    "exit": ("exit", "to", "destination", "ausfahrt", "nach"),
    "class": ("class", "vehicleclass", "vehicle", "vehicletype", "klasse", "fahrzeugart", "mode"),
    "count": ("count", "vehicles", "anzahl", "volume", "number", "n", "menge", "flow"),
}  # fmt: skip

#: Types of vehicles (`minisim.fleet`) -> the words of sheets for them.
CLASSES: Final[Mapping[str, tuple[str, ...]]] = {
    "car": ("car", "cars", "pkw", "light", "lights", "passengercar", "lightvehicles", "taxi"),
    "motorcycle": (
        "motorcycle", "motorcycles", "krad", "kraftrad", "mc", "twowheeler", "2w", "motorbike",
    ),
    "auto-rickshaw": ("autorickshaw", "rickshaw", "threewheeler", "3w", "auto"),
    "lcv": ("lcv", "lfz", "lieferwagen", "lieferfahrzeug", "lgv", "van", "vans"),
    "truck": (
        "truck", "trucks", "lkw", "lz", "lastzug", "hgv", "hgvs", "heavy", "ogv1", "ogv2",
        "lkwa", "singleunit", "articulated",
    ),
    "bus": ("bus", "buses", "psv", "kom", "coach"),
    "bicycle": ("bicycle", "bicycles", "rad", "fahrrad", "bike", "bikes", "pc", "cycle", "cycles"),
    "pedestrian": ("pedestrian", "pedestrians", "peds", "fussganger", "fuss"),
    "total": ("kfz", "all"),  # and see `is_total`
}  # fmt: skip

_TOTAL: Final = re.compile(
    r"(?<![^\W_])((grand|sub)?totals?|sums?|\w*summen?|gesamt|insgesamt|percent|prozent)(?![^\W_])|[Σ∑%]",
    re.IGNORECASE,
)

#: Classes that are not simulated, and why.
LEFT_OUT: Final = {
    "bicycle": "bicycles are not simulated",
    "pedestrian": "pedestrians are not simulated",
    "total": "a sum or a share, not a class",
}

#: Turns, from left to right, and back -> the words of sheets for them.
TURNS: Final[Mapping[str, tuple[str, ...]]] = {
    "left": ("left", "l", "lt", "links", "linksabbieger"),
    "through": ("through", "t", "th", "thru", "straight", "s", "g", "geradeaus", "gerade",
                "geradeausfahrer", "ahead"),
    "right": ("right", "r", "rt", "rechts", "rechtsabbieger"),
    "u-turn": ("uturn", "u", "w", "wender", "back"),
}  # fmt: skip

#: Points of the compass, clockwise from north.
COMPASS: Final = ("n", "ne", "e", "se", "s", "sw", "w", "nw")
_POINTS: Final = {
    "north": "n", "nord": "n", "east": "e", "ost": "e", "o": "e", "south": "s", "sud": "s",
    "west": "w", "northeast": "ne", "southeast": "se", "southwest": "sw", "northwest": "nw",
}  # fmt: skip


def plain(name: str) -> str:
    """A name in small letters and digits, without accents: "Zufahrt " is zufahrt."""
    letters = unicodedata.normalize("NFKD", name.casefold())
    return re.sub(r"[^a-z0-9]", "", letters)


def word_of(text: str, words: Mapping[str, Sequence[str]]) -> str | None:
    """The key of `words` that has this text among its words."""
    known = plain(text)
    return next((key for key, said in words.items() if known == plain(key) or known in said), None)


def is_total(text: str) -> bool:
    """Whether a cell or a column's name says that it holds a sum or share, such as "Summe Kfz"."""
    return _TOTAL.search(text) is not None


def near_word(text: str, words: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The one of `words` that is most like a text, or None if none is."""
    return next(iter(difflib.get_close_matches(plain(text), words, n=1, cutoff=cutoff)), None)


def hint(near: str | None) -> str:
    """What a message asks or says after an unknown word."""
    return f"; did you mean {near!r}?" if near else "; a mapping can say what it is"


def near_point(name: str) -> str | None:
    """The written-out point of the compass that is most like an arm's name, or None if none is."""
    return near_word(name, [word for word in _POINTS if len(word) > 2])


def compass(name: str) -> tuple[str, bool] | None:
    """The point of the compass that an arm's name means, and whether it is where traffic heads.

    "north" is the arm in the north; "NB" or "northbound" is traffic to the north, from the south.
    """
    known = plain(name)
    bound = re.fullmatch(r"(.+?)(?:bound|b)", known)
    for part, heads in ((known, False), (bound[1] if bound else "", True)):
        point = _POINTS.get(part, part)
        if point in COMPASS:
            return point, heads
    return None
