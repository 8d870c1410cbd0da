"""The film of `docs/live.md`: a drive in the page, whose speed is turned while it drives, then two cars side by side.

Headless Chromium draws each picture, and the drive waits for it; so the film is smooth on any computer.

    python benchmarks/live_film.py --out docs/img/live.webp
"""

from __future__ import annotations

import argparse
import io
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from chromium import Chromium, Window, until
from PIL import Image

from tral_env.interface import CONTROL_PERIOD_S
from tral_fsm.live.drive import LiveDrive, Order
from tral_fsm.live.frame import Course
from tral_fsm.live.page import Page

SIZE = 1280, 760
SHRUNK = 800, 475
"""Size of the film, px."""
TICKS = 16
"""The drive goes on by so many ticks from picture to picture: five pictures in a second of the drive."""
SHOWN_MS = 160
"""Each picture is shown for so long: a little faster than real time."""
_DRAWN_S = 0.5
"""The browser has this time to draw what it was sent."""


def main() -> None:
    """Make the film."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=int, default=36, help="of each of the two parts")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--quality", type=int, default=45, help="of WebP, 0 to 100")
    parser.add_argument("--out", type=Path, default=Path("runs/live.webp"))
    asked = parser.parse_args()
    pictures = list(film(asked.seed, asked.pictures))
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    first, *others = pictures
    first.save(
        asked.out, save_all=True, append_images=others, duration=SHOWN_MS, loop=0, quality=asked.quality, method=6
    )
    print(f"{asked.out}: {len(pictures)} pictures, {asked.out.stat().st_size / 1e6:.2f} MB")


def film(seed: int, count: int) -> Iterator[Image.Image]:
    """Pictures of one car whose speed is turned down in the middle, then of two cars side by side."""
    with closing(LiveDrive(Course(seed=seed), ["office"])) as live:
        live.order(lambda drive: drive.pause(True))
        thread = threading.Thread(target=live.run, daemon=True)
        thread.start()
        try:
            with closing(Page(live, port=0, drivers=("office", "corners"))) as page, Chromium(*SIZE) as chromium:
                window = chromium.window(page.url)
                window.until('!!by("Go on", "button")')
                window.until('!!document.querySelector("button[class*=Notification-close], .mantine-CloseButton-root")')
                window.ask('document.querySelectorAll("button[class*=Notification-close]").forEach(one => one.click())')
                yield from drive(live, window, count // 2, first=80)
                order(live, lambda drive: drive.lanes[0].retune("state[follow].speed", 0.4))
                yield from drive(live, window, count - count // 2)
                order(live, lambda drive: drive.drive_with(["office", "corners"]))
                yield from drive(live, window, count, first=160)
        finally:
            live.stop()
            thread.join()


def drive(live: LiveDrive, window: Window, count: int, first: int = 0) -> Iterator[Image.Image]:
    """Drive from picture to picture, after so many ticks that are not shown."""
    for k in range(count):
        ticks = first if k == 0 and first else TICKS
        due_s = live.frame.cars[0].time_s + (ticks - 0.5) * CONTROL_PERIOD_S
        order(live, lambda drive, ticks=ticks: drive.step(ticks))
        until(lambda due_s=due_s: live.frame.cars[0].time_s >= due_s)
        time.sleep(_DRAWN_S)
        yield Image.open(io.BytesIO(window.shot())).convert("RGB").resize(SHRUNK, Image.Resampling.LANCZOS)


def order(live: LiveDrive, what: Order) -> None:
    """Have something done, and wait until it is."""
    done = threading.Event()
    live.order(what)
    live.order(lambda drive: done.set())
    done.wait()


if __name__ == "__main__":
    main()
