"""The server of the explorer's page, which only this machine can reach, with a token, until the page is closed."""

from __future__ import annotations

import json
import os
import secrets
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from dovetail.errors import DovetailError
from dovetail.report.explorer import SAVED, Explorer
from dovetail.report.pages import environment, web_text
from dovetail.version import __version__

_ASSETS = {
    "uPlot.js": ("vendor/uPlot.iife.min.js", "text/javascript"),
    "uPlot.css": ("vendor/uPlot.min.css", "text/css"),
    "charts.js": ("charts.js", "text/javascript"),
    "charts.css": ("charts.css", "text/css"),
    "explore.js": ("explore.js", "text/javascript"),
    "explore.css": ("explore.css", "text/css"),
}
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_REDIRECT = (
    '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><meta name="referrer" content="no-referrer">'
    '<meta http-equiv="refresh" content="0; url={address}"><title>Dovetail</title></head>'
    '<body><p><a href="{address}">Open the page</a></p></body></html>\n'
)
_LONGEST_BODY = 64 * 1024
"""Largest size of a request in bytes."""
_BEAT = 0.5
"""Seconds between two messages to an open page, which keep the connection alive."""
_PATIENCE = 3.0
"""Seconds after the last page was closed at which the server ends; reloading a page takes less."""


class PageServer(ThreadingHTTPServer):
    """Serves one explorer at `address` to browsers on this machine that know the token in it.

    Parameters
    ----------
    explorer : Explorer
    port : int
        Of the loopback interface; 0 for any free one.

    Notes
    -----
    A request is answered only if its Host is this server (which prevents DNS rebinding), its path begins with the
    token, and its Origin, if sent, is this server; requests that compute must send it. The page may load only this
    server's scripts and styles, and no inline ones.

    The command line of a browser can be read by every user of the machine. A browser is therefore started with the path
    of a file that only this user can read, and which leads to the page (`redirect_file`).
    """

    daemon_threads = True
    block_on_close = False

    def __init__(self, explorer: Explorer, port: int = 0) -> None:
        super().__init__(("127.0.0.1", port), _Handler)
        self.explorer = explorer
        self.token = secrets.token_urlsafe(24)
        self.hosts = tuple(f"{name}:{self.server_address[1]}" for name in ("127.0.0.1", "localhost"))
        self.progress = ""
        self.fitting = threading.Lock()
        self._pages, self._left = 0, float("inf")
        self._counting = threading.Lock()

    @property
    def address(self) -> str:
        """Address of the page."""
        return f"http://{self.hosts[0]}/{self.token}/"

    @contextmanager
    def redirect_file(self) -> Iterator[Path]:
        """Yield a page that leads to `address`, in a folder that only this user can read; it is removed afterwards."""
        with TemporaryDirectory(prefix="dovetail-") as folder:  # with the rights 0700
            file = Path(folder) / "explorer.html"
            with open(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as stream:
                stream.write(_REDIRECT.format(address=self.address))
            yield file

    def count_page(self, change: int) -> None:
        """Record that a page was opened (1) or closed (-1)."""
        with self._counting:
            self._pages += change
            self._left = float("inf") if self._pages else time.monotonic()

    def service_actions(self) -> None:
        """End the server some time after the last page was closed."""
        with self._counting:
            ends = time.monotonic() - self._left > _PATIENCE
        if ends:
            self._left = float("inf")
            threading.Thread(target=self.shutdown, daemon=True).start()

    def report_progress(self, stage: str, done: int, total: int, note: str = "") -> None:
        """Store the progress of a fit for the page."""
        self.progress = f"{stage} {done} of {total} {note}".rstrip() if total > 1 else stage

    def handle_error(self, request: Any, client_address: Any) -> None:  # a browser that went away is not an error
        """Print nothing."""


class _Handler(BaseHTTPRequestHandler):
    """Answers one request."""

    server: PageServer
    protocol_version = "HTTP/1.1"
    server_version, sys_version = f"dovetail/{__version__}", ""
    timeout = 60
    disable_nagle_algorithm = True
    wbufsize = -1  # headers and body in one packet

    def log_message(self, *arguments: Any) -> None:
        """Print nothing, since the terminal belongs to the user."""

    def do_GET(self) -> None:
        """Answer with the page, a script, a style, or the messages to an open page."""
        path = self._allowed(stating_origin=False)
        if path is None:
            return
        if path == "":
            page = environment().get_template("explore.html.jinja").render(name=self.server.explorer.name)
            self._send(page.encode("utf-8", "replace"), "text/html; charset=utf-8")
        elif path in _ASSETS:
            name, kind = _ASSETS[path]
            self._send(web_text(name).encode(), f"{kind}; charset=utf-8")
        elif path == "favicon.ico":  # a browser asks for it unasked
            self._send(b"", "image/x-icon")
        elif path == "start":
            self._send_json(self.server.explorer.start())
        elif path == "alive":
            self._keep_open()
        else:
            self._refuse(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        """Answer with a computed FRF, modes, a fit or a file."""
        path = self._allowed(stating_origin=True)
        if path is None:
            return
        request = self._body()
        if request is None:
            return
        answers: dict[str, Callable[[Mapping[str, Any]], None]] = {
            "frf": self._frf,
            "modes": lambda request: self._send_json(self.server.explorer.modes(request["values"])),
            "fit": self._fit,
            "save": self._save,
        }
        if path not in answers:
            self._refuse(HTTPStatus.NOT_FOUND)
            return
        try:
            answers[path](request)
        except DovetailError as error:
            self._send_json({"error": str(error)}, HTTPStatus.UNPROCESSABLE_ENTITY)
        except (KeyError, TypeError, ValueError, OverflowError):
            self._refuse(HTTPStatus.BAD_REQUEST)

    def _frf(self, request: Mapping[str, Any]) -> None:
        self._send_json(self.server.explorer.frfs(request["values"], int(request.get("response", 0))))

    def _fit(self, request: Mapping[str, Any]) -> None:
        if not self.server.fitting.acquire(blocking=False):
            self._send_json({"error": "A fit is under way."}, HTTPStatus.CONFLICT)
            return
        try:
            locked = [str(name) for name in request.get("locked", [])]
            answer = self.server.explorer.fit(request["values"], locked, self.server.report_progress)
        finally:
            self.server.progress = ""
            self.server.fitting.release()
        self._send_json(answer)

    def _save(self, request: Mapping[str, Any]) -> None:
        kind = str(request["kind"])
        fit = request.get("fit")
        if fit is not None and not isinstance(fit, str):
            raise TypeError("a fit is named by a text")
        content = self.server.explorer.saved(kind, request["values"], fit)
        self._send(content, f"{SAVED[kind]}; charset=utf-8")

    def _allowed(self, *, stating_origin: bool) -> str | None:
        """Return the path after the token, or refuse the request and return None."""
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
        site = self.headers.get("Sec-Fetch-Site", "same-origin")
        token, slash, path = self.path.removeprefix("/").partition("/")
        opens_page = self.command == "GET" and path == "" and self.headers.get("Sec-Fetch-Mode") == "navigate"
        foreign = host not in self.server.hosts or (site not in ("same-origin", "none") and not opens_page)
        if foreign or (origin != f"http://{host}" and (origin is not None or stating_origin)):
            self._refuse(HTTPStatus.FORBIDDEN)
            return None
        if not slash or not secrets.compare_digest(token.encode(), self.server.token.encode()):
            self._refuse(HTTPStatus.FORBIDDEN)
            return None
        return path

    def _body(self) -> Mapping[str, Any] | None:
        """Return the request's JSON object, or refuse it and return None."""
        length = self.headers.get("Content-Length", "")
        kind = self.headers.get("Content-Type", "").partition(";")[0].strip()
        if not length.isdecimal() or int(length) > _LONGEST_BODY or kind != "application/json":
            self._refuse(HTTPStatus.BAD_REQUEST)
            return None
        try:
            content = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            content = None
        if not isinstance(content, dict):
            self._refuse(HTTPStatus.BAD_REQUEST)
            return None
        return content

    def _keep_open(self) -> None:
        """Keep the connection to the page open until it is closed, and send the progress of a fit."""
        self.server.count_page(1)
        self.close_connection = True
        try:
            self._head("text/event-stream", {"Connection": "close"})
            while True:
                self.wfile.write(f"data: {json.dumps(self.server.progress)}\n\n".encode())
                self.wfile.flush()
                time.sleep(_BEAT)
        except OSError:
            pass
        finally:
            self.server.count_page(-1)

    def _refuse(self, status: HTTPStatus) -> None:
        self.close_connection = True  # what it still sends is not read
        self._send(f"{status.phrase}\n".encode(), "text/plain; charset=utf-8", status)

    def _send_json(self, content: Mapping[str, Any], status: HTTPStatus = HTTPStatus.OK) -> None:
        self._send(json.dumps(content, ensure_ascii=False, allow_nan=False).encode(), "application/json", status)

    def _send(self, content: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK) -> None:
        self._head(kind, {"Content-Length": str(len(content))}, status)
        self.wfile.write(content)
        self.wfile.flush()

    def _head(self, kind: str, further: Mapping[str, str], status: HTTPStatus = HTTPStatus.OK) -> None:
        self.send_response(status)
        for name, value in {"Content-Type": kind, **further, **_HEADERS}.items():
            self.send_header(name, value)
        if self.close_connection and "Connection" not in further:
            self.send_header("Connection", "close")
        self.end_headers()
