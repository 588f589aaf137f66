"""Headless Chromium by its own protocol over a pipe: no driver, no package, nothing that listens."""

from __future__ import annotations

import base64
import contextlib
import fcntl
import json
import os
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from queue import Empty, Queue
from typing import Any

PATIENCE = 300.0
"""Seconds for an answer."""
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--hide-scrollbars",
    "--remote-debugging-pipe",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-dev-shm-usage",
)


def find_chromium() -> str | None:
    """Return the browser's command, or None where there is none."""
    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    return next((path for name in names if (path := shutil.which(name))), None)


class Browser:
    """A browser of its own, which ends with the block; messages are JSON with a zero byte behind each."""

    def __init__(self, command: str, profile: Path) -> None:
        read_here, write_there = os.pipe()
        read_there, write_here = os.pipe()
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (read_there, write_there)]  # beyond those that it takes
        words = ["sh", "-c", f'exec "$0" "$@" 3</dev/fd/{ends[0]} 4>/dev/fd/{ends[1]}', command, *FLAGS]
        words += [f"--user-data-dir={profile}", "about:blank"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self._process = subprocess.Popen(words, pass_fds=ends, **quiet)
        for end in (read_there, write_there, *ends):
            os.close(end)
        self._write, self._read = write_here, read_here
        self._answers: dict[int, Queue[dict[str, Any]]] = {}
        self.events: dict[str, list[dict[str, Any]]] = {}
        self._count = 0
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        rest = b""
        with contextlib.suppress(OSError):
            while chunk := os.read(self._read, 1 << 20):
                *messages, rest = (rest + chunk).split(b"\0")
                for text in messages:
                    message = json.loads(text)
                    if "id" in message:
                        self._answers[message["id"]].put(message)
                    else:
                        self.events.setdefault(message.get("sessionId", ""), []).append(message)

    def call(self, method: str, session: str = "", **parameters: Any) -> dict[str, Any]:
        """Call a method of the protocol and return its result."""
        self._count += 1
        number, answers = self._count, Queue[dict[str, Any]]()
        self._answers[number] = answers
        message: dict[str, Any] = {"id": number, "method": method, "params": parameters}
        text = json.dumps({**message, "sessionId": session} if session else message).encode() + b"\0"
        while text:
            text = text[os.write(self._write, text) :]
        try:
            answer = answers.get(timeout=PATIENCE)
        except Empty:
            raise TimeoutError(f"the browser does not answer {method}") from None
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        result: dict[str, Any] = answer["result"]
        return result

    @contextlib.contextmanager
    def page(self, url: str, width: int = 1440, height: int = 900, scheme: str = "light") -> Iterator[Page]:
        """Open a page of this size and colour scheme, and close it after the block."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = Page(self, session)
        try:
            page.open(url, width, height, scheme)
            yield page
        finally:
            self.call("Target.closeTarget", targetId=target)

    def close(self) -> None:
        """End the browser."""
        with contextlib.suppress(Exception):
            self.call("Browser.close")
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=10)
        self._process.kill()
        self._process.wait()
        os.close(self._write)


class Page:
    """One open page, with what it wrote to the console and what it asked the network for."""

    def __init__(self, browser: Browser, session: str) -> None:
        self._browser, self._session = browser, session

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the protocol on this page."""
        return self._browser.call(method, self._session, **parameters)

    def open(self, url: str, width: int, height: int, scheme: str) -> None:
        """Go to an address and wait until it is loaded."""
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.call("Emulation.setEmulatedMedia", features=features)
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        self.call("Page.navigate", url=url)
        self.wait_for("document.readyState === 'complete'")

    def evaluate(self, expression: str) -> Any:
        """Return the value of an expression, awaited if it is a promise."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(json.dumps(answer["exceptionDetails"])[:1000])
        return answer["result"].get("value")

    def wait_for(self, condition: str, seconds: float = PATIENCE) -> None:
        """Wait until an expression is true."""
        ends = time.monotonic() + seconds
        while not self.evaluate(condition):
            if time.monotonic() > ends:
                raise TimeoutError(f"never true: {condition}")
            time.sleep(0.02)

    def key(self, key: str) -> None:
        """Press and release a key."""
        text = {"text": key} if len(key) == 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def mouse(self, kind: str, x: float, y: float) -> None:
        """Move, press or release the mouse: ``"mouseMoved"``, ``"mousePressed"``, ``"mouseReleased"``."""
        held = {"button": "left", "buttons": 1, "clickCount": 1} if kind != "mouseReleased" else {"button": "left"}
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **({} if kind == "mouseMoved" else held))

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Draw the mouse with its button pressed."""
        self.mouse("mouseMoved", *start)
        self.mouse("mousePressed", *start)
        for part in (0.5, 1.0):
            x, y = (a + part * (b - a) for a, b in zip(start, end, strict=True))
            self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button="left", buttons=1)
        self.mouse("mouseReleased", *end)

    def box(self, selector: str) -> dict[str, float]:
        """Return where an element is in the window."""
        words = f"JSON.parse(JSON.stringify(document.querySelector({json.dumps(selector)}).getBoundingClientRect()))"
        box: dict[str, float] = self.evaluate(words)
        return box

    def errors(self) -> list[str]:
        """Return errors and warnings of the console, and scripts that failed."""
        kept = []
        for event in self._browser.events.get(self._session, []):
            details = event["params"]
            if event["method"] == "Runtime.exceptionThrown":
                kept.append(json.dumps(details["exceptionDetails"])[:300])
            elif event["method"] == "Log.entryAdded" and details["entry"]["level"] in ("error", "warning"):
                kept.append(details["entry"]["text"])
            elif event["method"] == "Runtime.consoleAPICalled" and details["type"] in ("error", "warning", "assert"):
                kept.append(json.dumps(details["args"])[:300])
        return kept

    def requests(self) -> list[str]:
        """Return every address that was asked for."""
        events = self._browser.events.get(self._session, [])
        return [event["params"]["request"]["url"] for event in events if event["method"] == "Network.requestWillBeSent"]

    def screenshot(self, path: Path, *, whole: bool = False) -> None:
        """Write a picture of the window, or of the whole page, as PNG."""
        answer = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(answer["data"]))

    def pdf(self, path: Path) -> int:
        """Print the page on A4 and return the number of sheets."""
        answer = self.call("Page.printToPDF", paperWidth=8.27, paperHeight=11.69, printBackground=False)
        content = base64.b64decode(answer["data"])
        path.write_bytes(content)
        return content.count(b"/Type /Page\n") or content.count(b"/Type /Page ")
