"""A local page with sliders, which simulates what they say: the server of `minisim lab`.

It listens on the loopback interface only, and answers only addresses that begin with a random
token. It reads no file of the user's and writes none.
"""

from __future__ import annotations

import hmac
import json
import secrets
import sys
import tempfile
import threading
from functools import lru_cache
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlencode, urlsplit

from figures.film.animate import write_animation
from figures.player.page import Player, script, template
from figures.player.scene import dumped, scene
from minisim.errors import InputError, MinisimError, choice, number
from minisim.parameters import parameters
from minisim.results.run import Run
from scenarios.lab import Setting

HOST = "127.0.0.1"
#: Length of an exported film [s].
FILM = 60.0
#: What may be exported, and its type.
EXPORTS = {
    "film.html": "text/html; charset=utf-8",
    "film.gif": "image/gif",
    "scene.json": "application/json",
}
_SECURITY = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
        "img-src data:; connect-src 'self'; frame-ancestors 'none'; form-action 'none'"
    ),
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
#: Steps of the sliders.
_STEPS = {"density": 10, "humans": 0.05, "error": 0.05, "seconds": 60}

_ONE_AT_A_TIME = threading.Lock()


class Lab(ThreadingHTTPServer):
    """The server. Its `address` is the page, `serve_forever` and `shutdown` run and end it.

    Port 0 stands for any free one. Raises `InputError` for a port that is in use.
    """

    daemon_threads = True

    def __init__(self, port: int = 0, token: str | None = None) -> None:
        self.token = secrets.token_urlsafe(16) if token is None else token
        try:
            super().__init__((HOST, port), _Handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise InputError(
                f"cannot listen on port {port}: {reason}; give another --port, or 0 for a free one"
            ) from error

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A page that has gone away, or asks for something newer, is no error."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)

    @property
    def address(self) -> str:
        """Where the page is."""
        return f"http://{HOST}:{self.server_port}/{self.token}/"


class _Handler(BaseHTTPRequestHandler):
    server: Lab
    server_version, sys_version = "minisim", ""

    def do_GET(self) -> None:
        asked = urlsplit(self.path)
        token, _, what = asked.path.removeprefix("/").partition("/")
        hosts = {f"{name}:{self.server.server_port}" for name in (HOST, "localhost")}
        if self.headers.get("Host") not in hosts or not hmac.compare_digest(
            token.encode(), self.server.token.encode()
        ):
            self._refuse(HTTPStatus.FORBIDDEN, "open the address that minisim lab has printed")
            return
        try:
            if what == "":
                self._answer(lab_page().encode(), EXPORTS["film.html"])
            elif what == "scene":
                self._answer(_answered(asked.query).encode(), EXPORTS["scene.json"])
            elif what in EXPORTS:
                self._answer(exported(what, asked.query), EXPORTS[what], save_as=what)
            else:
                self._refuse(HTTPStatus.NOT_FOUND, f"the lab has no {what[:40]!r}")
        except MinisimError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: the token would be in each line."""

    def _refuse(self, status: HTTPStatus, why: str) -> None:
        self._answer(json.dumps({"error": why}).encode(), EXPORTS["scene.json"], status)

    def _answer(
        self, data: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK, save_as: str = ""
    ) -> None:
        self.send_response(status)
        for name, value in _SECURITY.items():
            self.send_header(name, value)
        if save_as:
            self.send_header("Content-Disposition", f'attachment; filename="{save_as}"')
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)


@lru_cache(1)
def lab_page() -> str:
    """The page with the sliders."""
    fields = [
        {
            "name": it.name, "meaning": it.parameter.meaning, "unit": it.parameter.unit,
            "words": it.parameter.words, "default": it.default, **_range(it.parameter.allowed),
            "step": _STEPS.get(it.name, 1),
        }
        for it in parameters(Setting)
    ]  # fmt: skip
    return template("lab.html", player=script(), fields=json.dumps(fields))


def _range(allowed: str) -> dict[str, float | None]:
    """The ends of a range such as "0 … 1"."""
    low, _, high = allowed.removeprefix("integer ").partition(" … ")
    return {"low": float(low), "high": float(high)} if high else {"low": None, "high": None}


def _answered(query: str) -> str:
    """A scene of one of the runs, with the command line for the setting, as JSON."""
    setting, more = _asked(query, run="0", explained="0")
    which = int(choice("run", more["run"], ("0", "1")[: len(setting.recipes)]))
    explained = choice("explained", more["explained"], ("0", "1")) == "1"
    return _simulated(str(setting), which, explained)


@lru_cache(16)
def _simulated(setting: str, which: int, explained: bool) -> str:
    what = Setting.read(setting)
    run = _run(what, which, explained)
    made = scene(run, seconds=what.seconds, reasons=explained)
    return f'{{"scene":{dumped(made)},"command":{json.dumps(what.command)}}}'


def _run(setting: Setting, which: int, explained: bool) -> Run:
    with _ONE_AT_A_TIME:
        return setting.recipes[which].run(record="all", explain=explained)


def exported(name: str, query: str) -> bytes:
    """A file with `FILM` seconds of the runs from the time `from` on; a GIF or scene is of one."""
    setting, more = _asked(query, **{"from": "0"})
    try:
        start = float(more["from"])
    except ValueError:
        raise InputError(f"from [s] must be a number, got {more['from']!r}") from None
    start = min(number("from [s]", start, low=0, high=setting.seconds), setting.seconds - 1.0)
    when: dict[str, Any] = {"start": start, "seconds": min(FILM, setting.seconds - start)}
    count = len(setting.recipes) if name == "film.html" else 1
    runs = [_run(setting, which, explained=True) for which in range(count)]
    if name == "film.html":
        return Player(*(scene(run, **when) for run in runs)).page().encode()
    if name == "scene.json":
        return dumped(scene(runs[0], **when)).encode()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / name
        write_animation(runs[0], file, **when)
        return file.read_bytes()


def _asked(query: str, **more: str) -> tuple[Setting, dict[str, str]]:
    """The setting of a query, and what else it asks; `more` has the defaults."""
    pairs = parse_qsl(query, keep_blank_values=True)
    others = more | {name: value for name, value in pairs if name in more}
    return Setting.read(urlencode([it for it in pairs if it[0] not in more])), others
