"""The lab's server: for this computer and those who know the address."""

from __future__ import annotations

import http.client
import json
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from figures.player import lab as lab_module
from figures.player.lab import HOST, LabServer, exported
from minisim.errors import InputError
from scenarios.lab import Setting
from tests import ROOT

SHORT = "density=400&seconds=60"


@pytest.fixture(scope="module")
def lab() -> Iterator[LabServer]:
    with LabServer() as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def ask(
    lab: LabServer,
    path: str,
    *,
    token: str | None = None,
    host: str | None = None,
    method: str = "GET",
) -> tuple[int, Any, bytes]:
    connection = http.client.HTTPConnection(HOST, lab.server_port, timeout=300)
    connection.putrequest(method, f"/{lab.token if token is None else token}{path}", skip_host=True)
    connection.putheader("Host", f"{HOST}:{lab.server_port}" if host is None else host)
    connection.endheaders()
    answer = connection.getresponse()
    data = answer.read()
    connection.close()
    return answer.status, answer.headers, data


def test_it_listens_on_the_loopback_interface_only(lab: LabServer) -> None:
    assert lab.server_address[0] == "127.0.0.1"
    assert lab.address == f"http://127.0.0.1:{lab.server_port}/{lab.token}/"
    assert len(lab.token) >= 20
    with LabServer() as other:
        assert other.token != lab.token


def test_the_page_is_there_for_its_address_only(lab: LabServer) -> None:
    status, headers, data = ask(lab, "/")
    assert status == 200
    assert b"minisim-player" in data
    assert b"{{" not in data
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    for path in ("/", "/scene", f"/scene?{SHORT}", "/film.gif", "/nothing"):
        for token in ("", "wrong", lab.token[:-1], lab.token + "x", "%00", "é".encode().hex()):
            status, _, data = ask(lab, path, token=token)
            assert status == 403, (path, token)
            assert json.loads(data) == {"error": "open the address that minisim lab printed"}
        for host in ("", "evil.example", f"evil.example:{lab.server_port}", HOST):
            assert ask(lab, path, host=host)[0] == 403, (path, host)
    assert ask(lab, "/", host=f"localhost:{lab.server_port}")[0] == 200


def test_it_gives_no_other_file(lab: LabServer) -> None:
    for path in (
        "/lab.html",
        "/player.js",
        "/../../../etc/passwd",
        "/%2e%2e/lab.py",
        "//etc/x",
    ):
        status, _, data = ask(lab, path)
        assert status == 404, path
        assert "the lab has no" in json.loads(data)["error"]
    assert ask(lab, "/", method="POST")[0] == 501


def test_it_simulates_a_setting(lab: LabServer) -> None:
    for run, name in enumerate(("dim", "fixed-time")):
        status, _, data = ask(lab, f"/scene?{SHORT}&beside=fixed-time&run={run}&explained=1")
        assert status == 200
        content = json.loads(data)
        assert content["scene"]["controller"] == name
        assert content["scene"]["steps"] == 600
        assert content["scene"]["reasons"]
        assert content["command"] == Setting.read(f"{SHORT}&beside=fixed-time").command
    quick = json.loads(ask(lab, f"/scene?{SHORT}")[2])["scene"]
    assert quick["reasons"] is None


@pytest.mark.parametrize(
    ("query", "said"),
    [
        ("density=-1", "density"), ("controller=dmi", "did you mean 'dim'"),
        ("run=1", "run"), ("explained=2", "explained"), ("controller=/etc/passwd", "unknown"),
        ("profile=mine.toml", "unknown profile"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_told_in_a_sentence(lab: LabServer, query: str, said: str) -> None:
    status, _, data = ask(lab, f"/scene?{query}")
    assert status == 400
    assert said in json.loads(data)["error"]


def test_exports(lab: LabServer) -> None:
    begins = {"film.html": b"<!doctype html>", "film.gif": b"GIF89a", "scene.json": b"{"}
    for name, begin in begins.items():
        status, headers, data = ask(lab, f"/{name}?{SHORT}&from=58.5")
        assert status == 200
        assert data.startswith(begin)
        assert headers["Content-Disposition"] == f'attachment; filename="{name}"'
    assert json.loads(exported("scene.json", f"{SHORT}&from=58.5"))["start"] == 58.5
    both = exported("film.html", f"{SHORT}&from=58&beside=dim").decode()
    assert len(json.loads(re.findall(r'"application/json">(.*?)</script>', both)[0])) == 2
    for wrong in ("x", "-1", "nan", "61"):
        assert ask(lab, f"/scene.json?{SHORT}&from={wrong}")[0] == 400


def test_ten_minutes_are_simulated_in_half_a_second() -> None:
    for controller in ("dim", "fixed-time"):  # the first compiles
        for seed in range(2):
            begin = time.process_time()
            lab_module._simulated(f"controller={controller}&seed={seed}", 0, explained=False)
    assert time.process_time() - begin < 0.5


def test_a_port_in_use_is_told(lab: LabServer) -> None:
    with pytest.raises(InputError, match=f"cannot listen on port {lab.server_port}: .*in use"):
        LabServer(lab.server_port)


@pytest.mark.slow
def test_ctrl_c_stops_it_cleanly() -> None:
    command = [sys.executable, "-m", "minisim", "lab", "density=200"]
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        try:
            assert process.stdout is not None
            said = process.stdout.readline().decode() + process.stdout.readline().decode()
            process.send_signal(signal.SIGINT)
            rest, errors = process.communicate(timeout=20)
        finally:
            process.kill()
    found = r"The lab is at http://127\.0\.0\.1:\d+/[\w-]+/#density=200\nCtrl-C stops it\.\n"
    assert re.fullmatch(found, said)
    assert (process.returncode, rest, errors) == (0, b"stopped\n", b"")
