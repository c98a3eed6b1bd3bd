"""What `minisim lab` simulates: a setting, which an address can hold."""

from __future__ import annotations

import shlex
from urllib.parse import parse_qsl, urlencode

from dim import Dim
from minisim.errors import InputError, show
from minisim.parameters import declared, parameters, real, whole, word
from scenarios.controllers import CONTROLLERS
from scenarios.library import scenario_named
from scenarios.profiles import FAIR, PAPER
from scenarios.recipe import Recipe

#: Controllers that can be chosen: ready ones only, so that an address can load no file.
CHOICES = tuple(name for name in CONTROLLERS if not name.endswith("-as-run"))
NONE = "none"
_NAMES = {3: "three-way", 4: "four-way", 5: "five-way"}
_GATES = next(it.parameter.words for it in parameters(Dim) if it.name == "gate")


@declared(kw_only=True)
class Setting:
    """One run, or two side by side with the same arrivals."""

    controller: str = word("what decides", CHOICES, default="dim")
    beside: str = word("a second controller", (NONE, *CHOICES), default=NONE)
    arms: int = whole("of the junction", low=3, high=8, default=4)
    density: float = real("mean inflow per lane", "veh/h", low=0, high=1000, default=350.0)
    gate: str = word("when DIM's vehicles may enter", _GATES, default="clear")
    humans: float = real("share of human drivers among DIM's", low=0, high=1, default=0.0)
    error: float = real("how often DIM misreads an intent", low=0, high=1, default=0.0)
    profile: str = word("vehicle and speeds", (PAPER.name, FAIR.name), default=PAPER.name)
    seed: int = whole("of the arrivals", low=0, high=10**6, default=0)
    seconds: float = real("simulated time", "s", low=1, high=1800, default=600.0)

    def __post_init__(self) -> None:
        chosen = (self.controller, self.beside)
        for name in ("gate", "humans", "error"):
            if "dim" not in chosen and getattr(self, name) not in (0.0, "clear"):
                raise InputError(f"{name} has an effect only on dim, not on {self.controller}")

    @classmethod
    def read(cls, text: str) -> Setting:
        """The setting that an address holds, such as "controller=dim&density=300".

        Raises `InputError` for an unknown name, one that is given twice, or a wrong value.
        """
        given: dict[str, str | float] = {}
        counts = {it.name for it in parameters(Setting) if isinstance(it.default, int)}
        for name, value in parse_qsl(text, keep_blank_values=True):
            if name in given:
                raise InputError(f"{name} is given twice: {show(given[name])} and {show(value)}")
            given[name] = _number(value, whole=name in counts)
        return cls(**given)  # type: ignore[arg-type]  # checked by each field

    def __str__(self) -> str:
        """As `read` reads it; without what is as by default."""
        return urlencode([
            (it.name, str(getattr(self, it.name)).removesuffix(".0"))
            for it in parameters(Setting)
            if getattr(self, it.name) != it.default
        ])  # fmt: skip

    @property
    def recipes(self) -> tuple[Recipe, ...]:
        """The run, and the one beside it if there is one; humans drive among DIM's only."""
        scenario = scenario_named(
            self._name, density=self.density, profile=self.profile, horizon=self.seconds
        )
        return tuple(
            Recipe(
                scenario, self._spelling(name), self.seed, self.humans if name == "dim" else 0.0,
                on_collision="record",
            )
            for name in (self.controller, self.beside)
            if name != NONE
        )  # fmt: skip

    @property
    def command(self) -> str:
        """The command line that shows the same: two lines if humans drive in one run only."""
        chosen = [name for name in (self.controller, self.beside) if name != NONE]
        alone = self.humans > 0.0 and set(chosen) != {"dim"}
        parts = [[name] for name in chosen] if alone else [chosen]
        return "\n".join(self._line(*map(self._spelling, names)) for names in parts)

    def _line(self, controller: str, *beside: str) -> str:
        words = ["minisim", "animate", self._name, "-c", controller, "-d", f"{self.density:g}"]
        words += [word for name in beside for word in ("--beside", name)]
        words += ["-p", self.profile] * (self.profile != PAPER.name)
        words += ["-s", str(self.seed)] * (self.seed > 0)
        if self.humans and controller.startswith("dim"):
            words += ["--humans", f"{self.humans:g}"]
        length = f"{self.seconds:g}"
        return shlex.join([*words, "--horizon", length, "--from", "0", "--seconds", length])

    @property
    def _name(self) -> str:
        return _NAMES.get(self.arms, f"{self.arms}-way")

    def _spelling(self, name: str) -> str:
        if name != "dim":
            return name
        said = [] if self.gate == "clear" else [f"gate={self.gate}"]
        said += [f"perception=noisy(intent_error={self.error:g})"] if self.error else []
        return f"dim:{','.join(said)}" if said else name


def _number(text: str, *, whole: bool) -> str | float:
    """A number if the text is one, an integer if a whole one is wanted; else the text."""
    try:
        value = float(text)
    except ValueError:
        return text
    return int(value) if whole and value.is_integer() else value
