"""From the exposure of the explorer's camera to its picture in the page of the view in Chromium, on
loopback and over links that a driver at home may have.

The age is the one that the page shows, and by which it covers an old picture: from the exposure to
the drawing, and never less than that, since the page's own clock is known to the server only as of
the newest message that came from it. A proxy stands for the link: the delay is that of each way,
and a segment that is lost comes a round trip later.
"""

import sys
import time
from typing import Any

from benchmarks.company import chromium, page_address
from benchmarks.report import Case, parser, publish
from holozen import data
from holozen.testing import Wire
from tests.faults.proxy import Proxy

AIM = "p99 on loopback below 0.5 s, from which on the page covers a picture"
MBIT = 1e6 / 8  # bytes/s
LINKS = {
    "loopback": {},
    "100 ms and 2 % loss": {"delay": 0.1, "loss": 0.02},
    "10 Mbit/s and 20 ms": {"delay": 0.02, "rate": 10 * MBIT},
    "1 Mbit/s and 20 ms": {"delay": 0.02, "rate": 1 * MBIT},
}
SETTLES = 5.0  # s until the size of the pictures has followed the link
LISTEN = """
    window.seen = [];
    window.Worker = class extends Worker {
        constructor(url, options) {
            super(url, options);
            if (String(url) !== "/pictures.js") return;
            this.addEventListener("message", ({data: {age, sent}}) => {
                const now = performance.timeOrigin + performance.now();
                if (age !== undefined) seen.push(age * 1000 + now - sent);
            });
        }
    };
"""  # keeps the age of each picture, in ms, when it is on the screen


def ages(page: Any, seconds: float) -> list[float]:
    """The ages of the pictures that are shown within so many seconds, in ms."""
    page.evaluate("() => { seen.length = 0; }")
    page.wait_for_timeout(seconds * 1000)
    return [float(age) for age in page.evaluate("() => seen")]


def main() -> int:
    from playwright.sync_api import sync_playwright

    args = parser("glass_to_glass", __doc__).parse_args()
    turns, seconds = (1, 2.0) if args.quick else (6, 10.0)
    cases, rates = [Case(name, "ms", AIM, {"holozen": []}) for name in LINKS], {}
    with Wire() as wire, sync_playwright() as playwright:
        wire.start("sim", "--robot", str(data.find("urdf", "explorer.urdf.xacro")))
        wire.start("camera")
        view = wire.start("view", "--port", "0")
        view.wait_for_line("http://")
        address = page_address(view.err)
        browser = chromium(playwright)
        for case, faults in zip(cases, LINKS.values(), strict=True):
            with Proxy(int(address.rstrip("/").rpartition(":")[2])) as link:
                page = browser.new_page(viewport={"width": 640, "height": 480})
                page.add_init_script(LISTEN)
                page.goto(f"http://127.0.0.1:{link.port}/")
                page.wait_for_function("() => seen.length > 3")
                link.set(**faults)
                page.wait_for_timeout(SETTLES * 1000 if not args.quick else 500)
                before, began = link.carried, time.monotonic()
                case.rounds["holozen"] += [ages(page, seconds) for _ in range(turns)]
                took = time.monotonic() - began
                shown = sum(map(len, case.rounds["holozen"]))
                rates[case.name] = shown / took, (link.carried - before) / took
                page.close()
        browser.close()
    publish("glass_to_glass", cases, args.json, rates=rates)
    for name, (frames, size) in rates.items():
        print(
            f"{name}: {frames:.1f} pictures/s, {size / MBIT:.2f} Mbit/s with all else of the page"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
