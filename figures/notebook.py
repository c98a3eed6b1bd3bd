"""The lab in a notebook: sliders that simulate, and the player below them.

    from figures.notebook import Lab

    Lab("controller=dim&density=300")

It is a widget for JupyterLab, VS Code and what else shows widgets: its frame asks the kernel what
the page of `minisim lab` asks its server. It needs anywidget:
`pip install 'minisim-traffic[notebook]'`. A saved notebook keeps no lab, but it keeps the players
of `figures.play`, which need no package.
"""

from __future__ import annotations

from importlib import resources
from typing import Any

from figures.player.lab import answered, lab_page, setting_of
from minisim.errors import MissingExtraError, extra
from scenarios.lab import Setting

try:
    from anywidget import AnyWidget
    from traitlets import Unicode
except ImportError as error:
    raise MissingExtraError(f"the notebook's lab needs anywidget: {extra('notebook')}") from error


class Lab(AnyWidget):  # type: ignore[misc]  # has no types
    """A page with sliders. `setting` is what it shows, and the argument what it shows first.

    `scenarios.lab.Setting.read(lab.setting).recipes` are its runs, to go on with in Python.

    Raises `InputError` for a wrong setting.
    """

    _esm = (resources.files("figures.player") / "notebook.js").read_text(encoding="utf-8")
    page = Unicode().tag(sync=True)

    def __init__(self, setting: str = "") -> None:
        self.setting = str(Setting.read(setting))
        super().__init__(page=lab_page(self.setting))
        self.on_msg(self.answer)

    def answer(self, _: object, question: dict[str, Any], __: object) -> None:
        """Send what the lab answers to a question of the page."""
        told = answered(question["what"], question["query"])
        if told.status == 200:
            self.setting = str(setting_of(question["query"]))
        self.send({"id": question["id"], "status": int(told.status)}, [told.data])
