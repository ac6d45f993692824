"""A simulated world that plays beside the gateway, from a thread of its own, over real UDP on the loopback."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Iterator

from gateway.settings import Site
from sim.run import play_part
from sim.scenes import build_scene


class SimulatedWorld:
    """The part of a scene from one second to another, at real speed, so that every clock in it says what is true."""

    def __init__(self, scene: str, seed: int, *, from_s: float, until_s: float) -> None:
        self._from_s, self._until_s = from_s, until_s
        self._name, self._seed = scene, seed
        self._second = from_s
        self._failure: BaseException | None = None
        self.site: Site = build_scene(scene, start_ns=0, seed=seed).stated_site

    def fraction(self) -> float:
        """How much of it has been played, from 0 to 1."""
        return (self._second - self._from_s) / (self._until_s - self._from_s)

    @contextlib.contextmanager
    def playing(self, mavlink_port: int, radar_port: int) -> Iterator[None]:
        """Send to these ports of this machine while the context lasts. Raises what ended the sending, if something did."""
        stop = threading.Event()
        ports = {"mavlink": mavlink_port, "radar": radar_port}
        thread = threading.Thread(target=self._play, args=(ports, stop), name="simulated world", daemon=True)
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()
        if self._failure is not None:
            raise self._failure

    def _play(self, ports: dict[str, int], stop: threading.Event) -> None:
        try:
            self._send(ports, stop)
        except BaseException as error:  # raised again by `playing`
            self._failure = error

    def _send(self, ports: dict[str, int], stop: threading.Event) -> None:
        start_ns = (time.time_ns() - round(self._from_s * 1e9)) // 4000 * 4000
        scene = build_scene(self._name, start_ns=start_ns, seed=self._seed)
        addresses = {kind: (socket.AF_INET, ("127.0.0.1", port)) for kind, port in ports.items()}
        play_part(scene, addresses, from_s=self._from_s, until_s=self._until_s, stop=stop, progress=self._tell)

    def _tell(self, second: float) -> None:
        self._second = second
