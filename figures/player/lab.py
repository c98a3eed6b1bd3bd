"""A page with sliders, which simulates what they say; `minisim lab` serves it to this computer.

The server listens on the loopback interface only, and answers only addresses that begin with a
random token. It reads no file of the user's and writes none.
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
from typing import Any, NamedTuple
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


class Answer(NamedTuple):
    """What is sent to the page: bytes and their type, and the name of a file to save them in."""

    data: bytes
    kind: str
    status: HTTPStatus = HTTPStatus.OK
    save_as: str = ""


class LabServer(ThreadingHTTPServer):
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
    server: LabServer
    server_version, sys_version = "minisim", ""

    def do_GET(self) -> None:
        url = urlsplit(self.path)
        token, _, what = url.path.removeprefix("/").partition("/")
        hosts = {f"{name}:{self.server.server_port}" for name in (HOST, "localhost")}
        if self.headers.get("Host") not in hosts or not hmac.compare_digest(
            token.encode(), self.server.token.encode()
        ):
            self._send(_refused(HTTPStatus.FORBIDDEN, "open the address that minisim lab printed"))
        elif what == "":
            self._send(Answer(lab_page().encode(), EXPORTS["film.html"]))
        else:
            self._send(answered(what, url.query))

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: the token would be in each line."""

    def _send(self, answer: Answer) -> None:
        self.send_response(answer.status)
        for name, value in _SECURITY.items():
            self.send_header(name, value)
        if answer.save_as:
            self.send_header("Content-Disposition", f'attachment; filename="{answer.save_as}"')
        self.send_header("Content-Type", answer.kind)
        self.send_header("Content-Length", str(len(answer.data)))
        self.end_headers()
        self.wfile.write(answer.data)


def lab_page(setting: str = "") -> str:
    """The page with the sliders; in a notebook it shows a `setting` first."""
    fields = [
        {
            "name": it.name, "meaning": it.parameter.meaning, "unit": it.parameter.unit,
            "words": it.parameter.words, "default": it.default, **_range(it.parameter.allowed),
            "step": _STEPS.get(it.name, 1),
        }
        for it in parameters(Setting)
    ]  # fmt: skip
    return template(
        "lab.html", player=script(), fields=json.dumps(fields), setting=json.dumps(setting)
    )


def _range(allowed: str) -> dict[str, float | None]:
    """The ends of a range such as "0 … 1"."""
    low, _, high = allowed.removeprefix("integer ").partition(" … ")
    return {"low": float(low), "high": float(high)} if high else {"low": None, "high": None}


def answered(what: str, query: str) -> Answer:
    """What the lab answers to its page: a scene, a file of `EXPORTS`, or why not."""
    try:
        if what == "scene":
            return Answer(_scene(query).encode(), EXPORTS["scene.json"])
        if what in EXPORTS:
            return Answer(exported(what, query), EXPORTS[what], save_as=what)
    except MinisimError as error:
        return _refused(HTTPStatus.BAD_REQUEST, str(error))
    return _refused(HTTPStatus.NOT_FOUND, f"the lab has no {what[:40]!r}")


def _refused(status: HTTPStatus, why: str) -> Answer:
    return Answer(json.dumps({"error": why}).encode(), EXPORTS["scene.json"], status)


def _scene(query: str) -> str:
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


def setting_of(query: str) -> Setting:
    """What was set when the page asked this; raises `InputError` if that is no setting."""
    return _asked(query, run="", explained="", **{"from": ""})[0]


def _asked(query: str, **more: str) -> tuple[Setting, dict[str, str]]:
    """The setting of a query, and what else it asks; `more` has the defaults."""
    pairs = parse_qsl(query, keep_blank_values=True)
    others = more | {name: value for name, value in pairs if name in more}
    return Setting.read(urlencode([it for it in pairs if it[0] not in more])), others
