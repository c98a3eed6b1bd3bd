"""Chromium without a window, driven over a pipe by the DevTools protocol; it needs no package."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

#: How long to wait for an answer, or for something on a page [s].
PATIENCE = 30.0
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
    "--disable-dev-shm-usage", "--no-first-run", "--hide-scrollbars", "--remote-debugging-pipe",
)  # fmt: skip
#: Virtual keys by name: code of the key, and its text if it has any.
KEYS: Mapping[str, tuple[int, str]] = {
    "ArrowLeft": (37, ""), "ArrowRight": (39, ""), "Home": (36, ""), "End": (35, ""),
    "Escape": (27, ""), "Tab": (9, ""), "Enter": (13, "\r"), " ": (32, " "), "n": (78, "n"),
}  # fmt: skip


def browser_path() -> str | None:
    """Chromium or Chrome, if one is installed."""
    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    return next(filter(None, map(shutil.which, names)), None)


class Page:
    """A tab; `requests` and `errors` grow with what it asks of the network and complains about."""

    def __init__(self, browser: Browser, session: str) -> None:
        self._browser, self._session = browser, session
        self.requests: list[str] = []
        self.errors: list[str] = []

    def ask(self, method: str, **params: Any) -> Any:
        """Call a method of the protocol."""
        return self._browser.ask(method, self._session, **params)

    def size(self, width: int, height: int) -> None:
        """Make the window as large as this [px]."""
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height,
                 deviceScaleFactor=1, mobile=False)  # fmt: skip

    def open(self, address: str) -> None:
        """Go to an address and wait until it is loaded."""
        self.ask("Page.navigate", url=address)
        self.until("document.readyState === 'complete' && location.href !== 'about:blank'")

    def run(self, script: str) -> Any:
        """The value of an expression on the page, awaited if it is a promise."""
        answer = self.ask("Runtime.evaluate", expression=script, returnByValue=True,
                          awaitPromise=True, userGesture=True)  # fmt: skip
        if "exceptionDetails" in answer:
            raise AssertionError(answer["exceptionDetails"]["exception"].get("description"))
        return answer["result"].get("value")

    def until(self, script: str, patience: float = PATIENCE) -> None:
        """Wait until an expression is true, so many seconds at most."""
        end = time.monotonic() + patience
        while time.monotonic() < end:
            if self.run(f"Boolean({script})"):
                return
            time.sleep(0.02)
        raise AssertionError(f"never true: {script}")

    def click(self, x: float, y: float) -> None:
        """Press and release the left button of the mouse at a place of the window [px]."""
        for kind in ("mousePressed", "mouseReleased"):
            self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def press(self, key: str, *, shift: bool = False) -> None:
        """Press a key and let it go."""
        code, text = KEYS[key]
        event = {"key": key, "windowsVirtualKeyCode": code, "modifiers": 8 if shift else 0}
        self.ask(
            "Input.dispatchKeyEvent", type="keyDown", **event, **({"text": text} if text else {})
        )
        self.ask("Input.dispatchKeyEvent", type="keyUp", **event)

    def busy(self) -> float:
        """CPU time that the page's thread has spent so far [s], on a busy machine, too."""
        metrics = self.ask("Performance.getMetrics")["metrics"]
        return next(float(it["value"]) for it in metrics if it["name"] == "TaskDuration")

    def picture(self, path: Path) -> None:
        """Save what is seen as a PNG."""
        path.write_bytes(base64.b64decode(self.ask("Page.captureScreenshot")["data"]))


class Browser:
    """A running browser."""

    def __init__(self, reader: int, writer: int) -> None:
        self._reader, self._writer = reader, writer
        self._rest = b""
        self._count = 0
        self._pages: dict[str, Page] = {}

    def ask(self, method: str, session: str | None = None, **params: Any) -> Any:
        """Call a method of the protocol and wait for its answer."""
        self._count += 1
        call: dict[str, Any] = {"id": self._count, "method": method, "params": params}
        if session is not None:
            call["sessionId"] = session
        data = json.dumps(call).encode() + b"\0"
        while data:
            data = data[os.write(self._writer, data) :]
        for message in self._messages():
            if message.get("id") == self._count:
                assert "error" not in message, (method, message["error"])
                return message["result"]
            self._note(message)
        raise AssertionError("the browser has gone")

    def page(self, *, calm: bool = False) -> Page:
        """A new tab, in which motion is reduced if `calm`."""
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = self._pages[session] = Page(self, session)
        for domain in ("Page", "Runtime", "Network", "Log"):
            page.ask(f"{domain}.enable")
        page.ask("Performance.enable", timeDomain="threadTicks")
        motion = {"name": "prefers-reduced-motion", "value": "reduce" if calm else "no-preference"}
        page.ask("Emulation.setEmulatedMedia", features=[motion])
        return page

    def _messages(self) -> Iterator[Any]:
        end = time.monotonic() + PATIENCE
        while True:
            while b"\0" in self._rest:
                message, _, self._rest = self._rest.partition(b"\0")
                yield json.loads(message)
            ready, _, _ = select.select([self._reader], [], [], max(end - time.monotonic(), 0.0))
            assert ready, "the browser does not answer"
            data = os.read(self._reader, 1 << 20)
            if not data:
                return
            self._rest += data

    def _note(self, message: Any) -> None:
        page = self._pages.get(message.get("sessionId", ""))
        if page is None:
            return
        params = message.get("params", {})
        match message["method"]:
            case "Network.requestWillBeSent":
                page.requests.append(params["request"]["url"])
            case "Runtime.exceptionThrown":
                page.errors.append(params["exceptionDetails"]["exception"]["description"])
            case "Runtime.consoleAPICalled" if params["type"] in ("error", "warning", "assert"):
                page.errors.append(str(params["args"]))
            case "Log.entryAdded" if params["entry"]["level"] in ("error", "warning"):
                page.errors.append(params["entry"]["text"])


@contextmanager
def chromium(home: Path) -> Iterator[Browser]:
    """A browser whose profile is in the folder `home`; it is closed at the end."""
    program = browser_path()
    assert program is not None
    ours_in, theirs_out = os.pipe()
    theirs_in, ours_out = os.pipe()
    command = f'exec "$@" 3<&{theirs_in} 4>&{theirs_out}'
    process = subprocess.Popen(
        ["bash", "-c", command, "bash", program, *FLAGS, f"--user-data-dir={home}"],
        pass_fds=(theirs_in, theirs_out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(theirs_in)
    os.close(theirs_out)
    browser = Browser(ours_in, ours_out)
    try:
        yield browser
        browser.ask("Browser.close")
    finally:
        os.close(ours_in)
        os.close(ours_out)
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
