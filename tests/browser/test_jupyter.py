"""The lab and the player in a real JupyterLab, which is named by `MINISIM_JUPYTERLAB`.

The variable is a Python that has JupyterLab, minisim and its extra `notebook`.
"""

from __future__ import annotations

import json
import os
import secrets
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from PIL import Image

from figures.style import GRASS
from tests import ROOT
from tests.browser.chromium import Page, browser_path, chromium
from tests.colours import rgb

PYTHON = os.environ.get("MINISIM_JUPYTERLAB")
pytestmark = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.skipif(browser_path() is None, reason="needs chromium or chrome"),
    pytest.mark.skipif(
        PYTHON is None, reason="needs JupyterLab: MINISIM_JUPYTERLAB names a Python that has it"
    ),
]
#: How long a kernel may take to start, import and compile on a busy machine [s].
KERNEL = 180.0
CELLS = (
    "from figures.notebook import Lab\nlab = Lab('density=300&seconds=60')\nlab",
    "import minisim\nfrom dim import Dim\nfrom figures import play\n"
    "from scenarios import four_way\n"
    "run = minisim.simulate(four_way(350, horizon=100), Dim(), seed=1)\n"
    "play(run, start=60, seconds=20)",
)  # fmt: skip


def book() -> str:
    """A notebook with these cells, as JSON."""
    cells = [
        {"cell_type": "code", "id": f"cell{k}", "source": code, "metadata": {}, "outputs": [],
         "execution_count": None}
        for k, code in enumerate(CELLS)
    ]  # fmt: skip
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return json.dumps(
        {"nbformat": 4, "nbformat_minor": 5, "metadata": {"kernelspec": kernel}, "cells": cells}
    )


@pytest.fixture
def notebook(tmp_path: Path) -> Iterator[Page]:
    """The notebook, opened in JupyterLab and not run yet."""
    home = tmp_path / "jupyter"
    home.mkdir()
    (home / "lab.ipynb").write_text(book(), encoding="utf-8")
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    token = secrets.token_hex(16)
    options = [
        "--no-browser", "--allow-root", "--expose-app-in-browser", "--ServerApp.ip=127.0.0.1",
        f"--ServerApp.port={port}", "--ServerApp.port_retries=0", f"--ServerApp.root_dir={home}",
        f"--IdentityProvider.token={token}",
    ]  # fmt: skip
    own = {f"JUPYTER_{name}_DIR": str(tmp_path / name) for name in ("CONFIG", "DATA", "RUNTIME")}
    server = subprocess.Popen(
        [str(PYTHON), "-m", "jupyterlab", *options], cwd=home,
        env=os.environ | own | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        with chromium(tmp_path / "chromium") as browser:
            page = browser.page(calm=True)
            page.size(1280, 1800)
            for _ in range(600):
                with socket.socket() as probe:
                    if probe.connect_ex(("127.0.0.1", port)) == 0:
                        break
                time.sleep(0.1)
            page.open(f"http://127.0.0.1:{port}/lab/tree/lab.ipynb?token={token}")
            page.until(
                "window.jupyterapp && document.querySelectorAll('.jp-CodeCell').length === 2"
            )
            yield page
    finally:
        server.terminate()
        server.wait(30)


def looks(page: Page, file: Path) -> list[Image.Image]:
    """What is seen in the frames of the two cells."""
    page.picture(file)
    boxes = page.run("""[...document.querySelectorAll('.jp-CodeCell iframe')].map((it) => {
      const { left, top, right, bottom } = it.getBoundingClientRect();
      return [left, top, right, bottom].map(Math.round);
    })""")
    assert len(boxes) == 2
    return [Image.open(file).convert("RGB").crop(box) for box in boxes]


def test_the_lab_simulates_and_the_player_shows_itself(notebook: Page, tmp_path: Path) -> None:
    notebook.run("""addEventListener('message', ({ data }) => {
      if (data.what) (window.asked ??= []).push(data.query); })""")
    kernel = "jupyterapp.shell.currentWidget.sessionContext.session?.kernel"
    notebook.until(f"{kernel}?.status === 'idle'", KERNEL)
    notebook.run("void jupyterapp.commands.execute('notebook:run-all-cells')")
    frames = "document.querySelectorAll('.jp-CodeCell iframe')"
    notebook.until(f"{frames}.length === 2", KERNEL)
    notebook.until("window.asked?.at(-1)?.endsWith('explained=1')")
    assert notebook.run("asked") == [
        f"density=300&seconds=60&run=0&explained={told}" for told in (0, 1)
    ]
    file = tmp_path / "seen.png"
    grass = tuple(rgb(GRASS))
    for _ in range(100):
        shares = [
            sum(n for n, colour in it.getcolors(1 << 24) if colour == grass) / it.width / it.height
            for it in looks(notebook, file)
        ]
        if min(shares) > 0.1:
            break
    assert min(shares) > 0.1, "of each frame is grass: both have drawn a junction"
    notebook.run(f"{frames}[0].focus()")
    for _ in range(8):  # from control to control until one simulates anew
        notebook.press("Tab")
        notebook.press("ArrowRight")
        if notebook.run("new Promise((done) => setTimeout(() => done(asked.length > 2), 400))"):
            break
    notebook.until("asked.length > 3 && asked.at(-1).endsWith('explained=1')")
    assert notebook.run("asked.at(-1)") != "density=300&seconds=60&run=0&explained=1"
