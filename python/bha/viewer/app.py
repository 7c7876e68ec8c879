"""The viewer: a web server with a scene and its controls, and the clock that moves them."""

from __future__ import annotations

import contextlib
import html
import io
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Self

from numpy.typing import ArrayLike

from bha.errors import BhaError, InputError, way_out
from bha.support.extras import import_extra
from bha.viewer.panel import Panel
from bha.viewer.scene import Scene
from bha.viewer.show import Show

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.viewer.motions import Motion

#: The first port that is tried where none is asked for.
USUAL_PORT = 8080
#: How often the picture, and how often the controls are renewed, 1/s.
_PICTURES, _CONTROLS = 30.0, 6.0
#: Width over height of windows in which the controls cover the lower half.
_NARROW = 0.8
#: Height of the viewer in a notebook, pixels.
_NOTEBOOK_HEIGHT = 600


class Viewer:
    """An arm in the browser, until :meth:`stop`. A context manager; in a notebook it shows itself.

    Create one with :func:`bha.view`.
    """

    def __init__(self, arm: Arm, motions: Sequence[Motion], *, host: str = "127.0.0.1", port: int | None = None):
        """Begin to serve.

        Raises:
            InputError: the port is taken, or the host is not one of this computer's.
            MissingExtraError: viser is not installed.
        """
        self._show = Show(arm, motions)
        self._host = host
        self._server = serve(host, port)
        self._lock = threading.RLock()
        self._stopped = threading.Event()
        compared = bool(motions) and motions[0].measured is not None
        try:
            self._scene = Scene(self._server, arm, max(1, len(motions)), compared=compared)
            reach = self._scene.layout.reach
            self._panel = Panel(self._server.gui, self._show, self._scene.scale, reach, self._asked)
            self._server.on_client_connect(self._greet)
            self._draw(controls=True)
        except BaseException:
            stop_serving(self._server)
            raise
        self._clock = threading.Thread(target=self._run, name="viewer", daemon=True)
        self._clock.start()

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self._show.arm

    @property
    def url(self) -> str:
        """Where it is to be seen."""
        host = "localhost" if self._host in ("0.0.0.0", "127.0.0.1", "", "::") else self._host
        return f"http://{host}:{self._server.get_port()}"

    @property
    def show(self) -> Show:
        """What is shown; to be changed by the methods of the viewer."""
        return self._show

    def go_to(self, time: float) -> None:
        """Show the recorded motion at another time, s, by the clock of the log.

        Raises:
            InputError: nothing is recorded.
        """

        def act() -> None:
            self._show.go_back()
            self._show.go_to(time)

        self._do(act)

    def play(self, speed: float | None = None) -> None:
        """Let the recorded motion go on, ``speed`` times as fast as it was.

        Raises:
            InputError: nothing is recorded, or the speed is not positive.
        """
        if speed is not None and not speed > 0.0:
            raise InputError(f"speed: {speed}; a number above 0 is needed")

        def act() -> None:
            self._show.go_back()
            self._show.playing, self._show.speed = True, speed or self._show.speed

        self._do(act)

    def pause(self) -> None:
        """Let the recorded motion stand."""
        self._do(lambda: setattr(self._show, "playing", False))

    def command(self, pressures: ArrayLike) -> None:
        """Have the live arm follow these pressures, Pa absolute, shape (inputs,); it goes live first if it was not.

        Raises:
            InputError: another shape, or a value that is negative or not finite.
        """

        def act() -> None:
            if not self._show.live:
                self._show.go_live()
            self._show.command(pressures)

        self._do(act)

    def wait(self) -> None:
        """Return when the viewer is stopped, by another thread or by Ctrl-C, which goes on as KeyboardInterrupt."""
        while not self._stopped.wait(0.2):  # in pieces: some systems hold signals back until a wait ends
            pass

    def stop(self) -> None:
        """End the server; does nothing the second time."""
        if not self._stopped.is_set():
            self._stopped.set()
            self._clock.join()
            stop_serving(self._server)

    def __enter__(self) -> Self:
        """The viewer itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the server."""
        self.stop()

    def __repr__(self) -> str:
        """Arm and address in one line."""
        where = "stopped" if self._stopped.is_set() else f"at {self.url}"
        return f"<Viewer of {self.arm.name!r}, {where}>"

    def _repr_html_(self) -> str:
        """The running viewer in a notebook on the same computer; else its address."""
        if self._stopped.is_set():
            return html.escape(repr(self))
        url = html.escape(self.url, quote=True)
        return (
            f'<iframe src="{url}" width="100%" height="{_NOTEBOOK_HEIGHT}" style="border:0"></iframe>'
            f'<p><a href="{url}" target="_blank">{url}</a></p>'
        )

    def _greet(self, client: Any) -> None:
        if client.camera.aspect < _NARROW:
            self._scene.look_from_afar(client.camera, narrow=True)

    def _do(self, act: Callable[[], Any]) -> None:
        with self._lock:
            act()
            self._draw(controls=True)

    def _asked(self, act: Callable[[], Any]) -> None:
        """Do what a user has asked for; what goes wrong is told beside the controls."""
        try:
            self._do(act)
        except BhaError as error:
            self._panel.say(str(error))

    def _draw(self, *, controls: bool) -> None:
        moments = self._show.moments()
        self._scene.frames_wanted = self._panel.frames_wanted
        with self._server.atomic():
            self._scene.draw(moments, self._panel.magnify)
        if controls:
            self._panel.refresh(moments[0])

    def _run(self) -> None:
        """The clock: as much time passes in the show as passes outside."""
        last, controls = time.monotonic(), 0.0
        while not self._stopped.wait(1.0 / _PICTURES):
            now = time.monotonic()
            with self._lock:
                try:
                    if self._show.advance(now - last):
                        self._draw(controls=now - controls > 1.0 / _CONTROLS)
                        controls = now if now - controls > 1.0 / _CONTROLS else controls
                except BhaError as error:  # the live arm diverges
                    self._panel.say(str(error))
                    self._show.recover()
                    self._draw(controls=True)
            last = now


def serve(host: str, port: int | None) -> Any:
    """A ``viser.ViserServer`` that says nothing on the terminal.

    Raises:
        InputError: the port is taken, or the host is not one of this computer's.
        MissingExtraError: viser is not installed.
    """
    viser = import_extra("viser", extra="view", purpose="The viewer")
    if not 0 <= (port or 0) <= 65535:
        raise InputError(f"port: {port}; allowed: 0 (any that is free) to 65535")
    # viser would take the next free port, and try a host that does not exist a thousand times.
    try:
        socket.create_server((host, port or 0)).close()
    except OSError as error:
        said = way_out(error).partition(" (while")[0]
        advice = "take another port, or 0 for any that is free" if port else "take 127.0.0.1 or 0.0.0.0"
        raise InputError(f"{host}, port {port}: {said}; {advice}") from error
    with quiet():
        return viser.ViserServer(host=host, port=USUAL_PORT if port is None else port, verbose=False)


def stop_serving(server: Any) -> None:
    """End a server."""
    with quiet():
        server.stop()


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """viser prints a frame with its address and a farewell: ours to say."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
