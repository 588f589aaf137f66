"""How long the explorer takes from an input to the drawn curve, and to its first paint, in headless Chromium.

    python tests/benchmarks/explorer_latency.py [--assembly FILE] [--measured FILE] [--inputs N] [--picture FILE.png]

Single inputs: a slider is moved, and moved again when its curve stands there. A drag: sixty inputs a second; what is
overtaken by a newer one is not drawn. The time begins with the input and ends when the chart has drawn; the screen
follows with its next picture. The picture is the page after a fit from the middle of the ranges, that curve kept.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import threading
from pathlib import Path

import numpy as np

import dovetail
from dovetail.report.explorer import Explorer
from dovetail.report.page_server import PageServer

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "browser"))
from chromium import Browser, Page, find_chromium  # noqa: E402

MOVE = """
(async () => {
  const sliders = [...document.querySelectorAll("input[type=range]")];
  const drawn = () => performance.getEntriesByName("input to curve").length;
  const pause = (ms) => new Promise((go) => setTimeout(go, ms));
  performance.clearMeasures();
  for (let number = 0; number < INPUTS; number++) {
    const slider = sliders[number % sliders.length];
    slider.value = 0.2 + 0.6 * Math.abs(Math.sin(number));
    slider.dispatchEvent(new Event("input"));
    if (EVERY) await pause(EVERY); else { while (drawn() <= number) await pause(2); await pause(250); }
  }
  await pause(500);
  return performance.getEntriesByName("input to curve").map((entry) => entry.duration);
})()
"""


def distribution(name: str, times: list[float]) -> str:
    """Say how times [ms] are distributed."""
    ends = np.percentile(times, [5, 50, 95])
    return f"{name}: {len(times)} curves; 5 %, median, 95 %: {', '.join(f'{end:.0f}' for end in ends)} ms"


def measure(page: Page, inputs: int) -> list[str]:
    """Return lines that say how long curves take."""
    page.wait_for("document.documentElement.dataset.ready === 'true'")
    paint = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
    single = page.evaluate(MOVE.replace("INPUTS", str(inputs)).replace("EVERY", "0"))
    drag = page.evaluate(MOVE.replace("INPUTS", str(2 * inputs)).replace("EVERY", "16.7"))
    lines = [f"first paint: {paint:.0f} ms", distribution("single inputs", single)]
    return [*lines, distribution(f"a drag of {2 * inputs} inputs", drag)]


def picture(page: Page, file: Path) -> None:
    """Fit from the middle of the ranges, with that curve kept, and write a picture of the page."""
    page.wait_for("document.documentElement.dataset.ready === 'true'")
    page.evaluate("document.getElementById('keep').click(); 0")
    page.wait_for("document.querySelector('.key-before') !== null")
    page.evaluate("document.getElementById('fit').click(); 0")
    page.wait_for("document.querySelector('.interval:not([hidden])') !== null", 120)
    page.evaluate("new Promise((go) => setTimeout(go, 1500))")
    page.evaluate("document.querySelector('#modes button').click(); 0")
    page.screenshot(file)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--assembly", type=Path, default=ROOT / "assemblies" / "bt40_er32.yaml")
    parser.add_argument("--measured", type=Path, default=ROOT / "assemblies" / "measurements" / "h0_j_t0_60Nm.uff")
    parser.add_argument("--inputs", type=int, default=60)
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    command = find_chromium()
    if command is None:
        sys.exit("there is no Chromium on this machine")
    explorer = Explorer(dovetail.load(options.assembly), [dovetail.read_frf(options.measured)])
    with PageServer(explorer) as server, tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser = Browser(command, Path(profile))
        with browser.page(server.address, 1280, 820) as page:
            if options.picture is not None:
                picture(page, options.picture)
            else:
                print(f"{options.assembly.name}, {options.measured.name}")
                print(*measure(page, options.inputs), sep="\n")
        browser.close()


if __name__ == "__main__":
    main()
