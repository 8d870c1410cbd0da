"""What the page of `tral live` costs: CPU time of a drive without a page, with one, and with a browser; bytes a second.

The browser is a process of its own that takes what it is sent and draws nothing.

    python benchmarks/live.py --seconds 20 --out runs/live.json
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
import threading
import time
from pathlib import Path
from typing import Any

from tral_fsm.evaluation.host import host
from tral_fsm.live.drive import LiveDrive
from tral_fsm.live.frame import Course
from tral_fsm.live.page import Page

MODES = ("no page", "page", "page, one browser", "page, two browsers")


def main() -> None:
    """Measure all modes, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="each mode is measured for so long")
    parser.add_argument("--seed", type=int, default=1007)
    parser.add_argument("--camera", action="store_true", help="send the camera's pictures too, which needs OpenGL")
    parser.add_argument("--out", type=Path, default=Path("runs/live.json"))
    asked = parser.parse_args()
    found = {mode: measure(mode, asked.seconds, asked.seed, asked.camera) for mode in MODES}
    report = {
        "seconds": asked.seconds,
        "seed": asked.seed,
        "camera": asked.camera,
        "modes": found,
        "host": host(),
        "load": os.getloadavg(),
    }
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    asked.out.write_text(json.dumps(report, indent=2) + "\n")
    print(json.dumps(found, indent=2))


def measure(mode: str, seconds: float, seed: int, camera: bool) -> dict[str, Any]:
    """Drive in real time, then as fast as it goes; CPU times are those of this process."""
    live = LiveDrive(Course(seed=seed), ["office"])
    live.shows_camera = camera
    page = None if mode == "no page" else Page(live, port=0)
    browsers = [Eye(page.url) for _ in range({"page, one browser": 1, "page, two browsers": 2}.get(mode, 0)) if page]
    live.run(2.0)
    live.restart()
    for browser in browsers:
        browser.count()
    cpu, begun, drove, worst = time.process_time(), time.monotonic(), 0.0, 0.0
    thread_cpu = time.thread_time()
    while time.monotonic() - begun < seconds:
        live.run(0.5)
        worst = max(worst, live.pace.worst_s)
        if live.frame.cars[0].ended:
            drove += live.frame.cars[0].time_s
            live.restart()
    passed = time.monotonic() - begun
    drove += live.frame.cars[0].time_s
    figures = {
        "real_time": drove / passed,
        "cpu_share": (time.process_time() - cpu) / passed,
        "cpu_share_of_the_thread_that_drives": (time.thread_time() - thread_cpu) / passed,
        "worst_lateness_ms": 1000 * worst,
        "bytes_a_second": [browser.count() / passed for browser in browsers],
    }
    figures |= _fast(live, seconds / 4)
    for browser in browsers:
        browser.close()
    if page is not None:
        page.close()
    live.close()
    return figures


def _fast(live: LiveDrive, seconds: float) -> dict[str, float]:
    """Ticks in a second of CPU time of the thread that drives, and of the clock, as fast as it goes."""
    live.restart()
    live.set_speed(math.inf)
    ticks, cpu, begun = 0, time.thread_time(), time.monotonic()
    while time.monotonic() - begun < seconds:
        live.turn()
        ticks += 1
        if live.frame.cars[0].ended:
            live.restart()
    return {
        "ticks_a_cpu_second": ticks / (time.thread_time() - cpu),
        "ticks_a_second": ticks / (time.monotonic() - begun),
    }


class Eye:
    """A browser in a process of its own, that counts what it is sent."""

    def __init__(self, url: str) -> None:
        """Open a page."""
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_look, args=(url, theirs), daemon=True)
        self._process.start()
        self._pipe.recv()

    def count(self) -> int:
        """Bytes since the last call."""
        self._pipe.send("count")
        count: int = self._pipe.recv()
        return count

    def close(self) -> None:
        """Close the window."""
        self._process.terminate()
        self._process.join()


def _look(url: str, pipe: Any) -> None:
    import msgspec
    import viser
    from viser import _messages as messages
    from websockets.sync.client import connect

    protocol: Any = f"viser-v{viser.__version__}"
    eye = messages.ViewerCameraMessage(
        (1.0, 0.0, 0.0, 0.0), (0.0, -3.0, 3.0), 1.0, 0.1, 100.0, 600, 800, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    )
    received = [0]
    with connect(url.replace("http", "ws", 1), subprotocols=[protocol], max_size=None) as line:
        line.send(msgspec.msgpack.encode(eye.as_serializable_dict()))
        line.recv()
        pipe.send("open")

        def take() -> None:
            for data in line:
                received[0] += len(data)

        threading.Thread(target=take, daemon=True).start()
        while True:
            pipe.recv()
            pipe.send(received[0])
            received[0] = 0


if __name__ == "__main__":
    main()
