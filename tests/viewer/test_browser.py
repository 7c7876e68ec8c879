"""The viewer as a browser sees it: headless Chromium, by software, in a small window."""

from __future__ import annotations

import io
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bha
from bha.errors import InputError, MissingExtraError
from bha.viewer import motions_of, page

from . import made_log as made

pytest.importorskip("viser", reason="the viewer needs viser (extra view)")
image = pytest.importorskip("PIL.Image")

#: viser and websockets warn of what is theirs to mend.
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")
ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    api = pytest.importorskip("playwright.sync_api", reason="a browser is led by playwright, which is not installed")
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    with api.sync_playwright() as playwright:
        try:
            opened = playwright.chromium.launch(executable_path=found, args=ARGUMENTS)
        except api.Error as error:
            pytest.skip(f"no browser: neither chromium in the path nor one of playwright's ({str(error)[:80]})")
        yield opened
        opened.close()


def until(true: Callable[[], bool], what: str) -> None:
    for _ in range(600):
        if true():
            return
        time.sleep(0.05)
    pytest.fail(f"it never came about that {what}")


def pixels(page: Any) -> np.ndarray[Any, Any]:
    """The middle of the window, beside the controls."""
    shot = page.screenshot(clip={"x": 300, "y": 0, "width": 260, "height": 400}, timeout=60_000)
    return np.asarray(image.open(io.BytesIO(shot)).convert("RGB"), dtype=np.int64)


def colorful(picture: np.ndarray[Any, Any]) -> int:
    """Number of pixels that are far from grey: bellows and axes, no grid and no text."""
    return int((np.ptp(picture, axis=-1) > 60).sum())


def test_the_arm_is_seen_and_follows_the_slider(browser: Any) -> None:
    with bha.view(made.arm(), port=0) as viewer:
        opened = browser.new_page(viewport={"width": 900, "height": 400})
        faults: list[str] = []
        opened.on("pageerror", lambda error: faults.append(str(error)))
        opened.goto(viewer.url)
        slider = opened.get_by_role("slider").first
        slider.wait_for(timeout=60_000)
        shown: list[np.ndarray[Any, Any]] = []

        def drawn() -> bool:
            shown.append(pixels(opened))
            return colorful(shown[-1]) > 500

        until(drawn, "the arm is drawn")
        before = viewer.show.moments()[0]
        slider.focus()
        slider.press("End")
        until(lambda: viewer.show.commands[0] == 2.2e5, "the slider's pressure is commanded")
        until(lambda: bool(abs(viewer.show.moments()[0].lengths - before.lengths).max() > 0.03), "the arm moves")
        until(lambda: bool((abs(pixels(opened) - shown[-1]).max(axis=-1) > 60).sum() > 500), "the picture moves")
        assert opened.locator("text=bha_nominal").count() == 1
        assert faults == []
        opened.close()


def test_a_page_plays_from_a_file_without_a_network(browser: Any, tmp_path: Path) -> None:
    arm = made.arm()
    written = page(arm, motions_of(arm, [made.log(seconds=1.0)]), rate=2.0).write(tmp_path / "page.html")
    context = browser.new_context(offline=True, viewport={"width": 900, "height": 400})
    opened = context.new_page()
    asked: list[str] = []
    opened.on("request", lambda request: asked.append(request.url))
    faults: list[str] = []
    opened.on("pageerror", lambda error: faults.append(str(error)))
    opened.goto(written.as_uri())
    until(lambda: colorful(pixels(opened)) > 500, "the arm is drawn")
    outside = [url for url in asked if not url.startswith(("data:", "blob:", "file:"))]
    assert outside == []
    assert faults == []
    context.close()


def test_from_python_it_goes_where_it_is_told() -> None:
    arm, log = made.arm(), made.log()
    with bha.view(arm, log, port=0) as viewer:
        assert viewer.url in viewer._repr_html_()
        viewer.go_to(101.0)
        assert viewer.show.time == 101.0
        viewer.play(speed=0.5)
        until(lambda: viewer.show.time > 101.1, "time goes on")
        viewer.pause()
        viewer.command(np.full(9, 1.3e5))
        assert viewer.show.live
        rest = arm.static_lengths(np.full(9, 1.3e5))
        until(lambda: bool(np.abs(viewer.show.moments()[0].lengths - rest).max() < 1e-3), "the arm comes to rest")
        viewer.go_to(100.5)
        assert not viewer.show.live
        with pytest.raises(InputError, match="speed"):
            viewer.play(0.0)
        viewer._asked(lambda: viewer.show.command([1.0]))  # as a user of the page asks
        assert "pressures: expected shape" in viewer._panel._message.content
    assert repr(viewer) == "<Viewer of 'bha_nominal', stopped>"
    viewer.stop()


def test_a_taken_port_a_strange_host_and_a_missing_extra_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=rf"port {port}: .*in use; take another port, or 0"):
            bha.view(made.arm(), port=port)
    with pytest.raises(InputError, match=r"127\.0\.0\.1 or 0\.0\.0\.0"):
        bha.view(made.arm(), host="no.such.host.invalid", port=0)
    with pytest.raises(InputError, match=r"0 .* to 65535"):
        bha.view(made.arm(), port=70_000)
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'bha\[view\]'"):
        bha.view(made.arm(), port=0)


def test_the_command_serves_until_ctrl_c_and_ends_at_once(tmp_path: Path) -> None:
    made.log(seconds=0.5).write(tmp_path / "log.csv")
    command = [sys.executable, "-m", "bha", "view", "bha_nominal", "log.csv", "--port", "0", "--no-browser"]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(
        command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("bha_nominal at http://localhost:")
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=30)
    assert process.returncode == 130
    assert out == ""
    assert errors == "interrupted\n"


def test_the_command_writes_a_page_and_says_what_is_wrong(tmp_path: Path) -> None:
    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "bha", "view", *arguments]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    made.log(seconds=0.5).write(tmp_path / "log.csv")
    done = run("bha_nominal", "log.csv", "--page", "arm.html", "--video", "arm.gif", "--rate", "5")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "Written: arm.html, arm.gif\n"
    assert (tmp_path / "arm.gif").read_bytes().startswith(b"GIF89a")
    assert (tmp_path / "arm.html").read_text(encoding="utf-8").lstrip().lower().startswith("<!doctype html>")
    refused = run("bha_nominal", "log.csv", "--page", "arm.pdf")
    assert (refused.returncode, refused.stderr) == (
        1,
        "error: arm.pdf: unknown extension .pdf; pages are written as .html\n",
    )
    nothing = run("bha_nominal", "no.csv")
    assert nothing.returncode == 1
    assert "no.csv" in nothing.stderr
