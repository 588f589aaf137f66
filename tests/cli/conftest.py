from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sysconfig
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner, Result

import dovetail
from dovetail.cli.app import app
from support.waiting import PATIENCE

SMALL = """\
extends: {parent}
name: small
identification:
  samples: 200
  reducer: {{model: none}}
  regressor: {{model: mlp, hidden: [32, 16], max_epochs: 30, learning_rate: 0.005}}
"""

TRUTH = {
    "synthetic": True,
    "parameters": {"k": "3 MN/m", "c": "40 N s/m"},
    "natural_frequencies_Hz": [275.66],
}

Run = Callable[..., Result]

BAR = b"\x1b[?25l"
"""What hides the cursor, with which rich begins a bar."""


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep every test away from the user's cache, and from the width of whoever runs it."""
    monkeypatch.setenv("DOVETAIL_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("COLUMNS", "80")


@pytest.fixture(scope="module", autouse=True)
def _rough_figures() -> Iterator[None]:
    """Draw figures without room for their labels and with few pixels, in half the time; `report` tests the layout."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    save = Figure.savefig

    def save_roughly(self: Figure, *arguments: object, **options: object) -> None:
        save(self, *arguments, **{**options, "dpi": 20} if options.get("format") == "png" else options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ConstrainedLayoutEngine, "execute", lambda self, figure: None)
        patch.setattr(Figure, "savefig", save_roughly)
        yield


@pytest.fixture(scope="module", autouse=True)
def _warnings_of_one_description_are_found_once() -> Iterator[None]:
    """Find what looks wrong in a description once in a module: most tests load the same few."""
    from dovetail import assembly as package

    found, find = {}, package.find_warnings

    def find_once(assembly: dovetail.Assembly, *, effects: bool = True) -> tuple[str, ...]:
        parts = assembly.description.substructures.values()
        if any(part.name in ("matrices", "measured") for part in parts):  # whose files may change
            return find(assembly, effects=effects)
        models = [*parts, *(joint.connection.model for joint in assembly.description.joints.values())]
        key = effects, assembly.description.text, *map(type, models)
        if key not in found:
            found[key] = find(assembly, effects=effects)
        return found[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(package, "find_warnings", find_once)
        yield


@pytest.fixture(scope="session")
def run() -> Run:
    """Run a command in this process: ``run("check", path)``."""

    def invoke(*arguments: object, code: int = 0) -> Result:
        result = CliRunner().invoke(app, [str(argument) for argument in arguments])
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        assert result.exit_code == code, result.output
        return result

    return invoke


@pytest.fixture(scope="session")
def command() -> str:
    """The installed command."""
    return str(Path(sysconfig.get_path("scripts")) / "dovetail")


@pytest.fixture
def environment() -> dict[str, str]:
    """This environment with one thread for torch: what is small here gains nothing by more."""
    return {**os.environ, "OMP_NUM_THREADS": "1"}


@pytest.fixture
def interruptible(command: str, environment: dict[str, str]) -> Callable[..., subprocess.Popen[str]]:
    """Start the installed command so that Ctrl-C reaches it, also where this process was started to ignore it."""

    def start(*arguments: object) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [command, *(str(argument) for argument in arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )

    return start


@dataclass(frozen=True)
class Shown:
    """What a command wrote to a terminal, when [s] the first bar stood there, and how long it was watched."""

    written: str
    first_bar: float
    seconds: float
    code: int


@pytest.fixture
def on_a_terminal(environment: dict[str, str]) -> Callable[..., Shown]:
    """Run a command on a terminal of 80 columns, to its end or until a bar stands there."""
    pty = pytest.importorskip("pty")
    import fcntl
    import struct
    import termios

    def call(*command: object, until_bar: bool = False) -> Shown:
        own, terminal = pty.openpty()
        fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 50, 80, 0, 0))
        shown = {**environment, "TERM": "xterm-256color"}
        shown.pop("COLUMNS", None)
        began, first, written = time.monotonic(), float("inf"), bytearray()
        words = [str(word) for word in command]
        files = {"stdin": terminal, "stdout": terminal, "stderr": terminal}
        process = subprocess.Popen(words, **files, env=shown, start_new_session=True)
        os.close(terminal)
        while not (until_bar and first < float("inf")):
            try:
                part = os.read(own, 65536)
            except OSError:  # the terminal closes with the last process that holds it
                break
            if not part:
                break
            written += part
            if first == float("inf") and BAR in written:
                first = time.monotonic() - began
        seconds = time.monotonic() - began
        if until_bar:
            os.killpg(process.pid, signal.SIGKILL)
        os.close(own)
        return Shown(written.decode(errors="replace"), first, seconds, process.wait(timeout=PATIENCE))

    return call


@pytest.fixture
def shell(command: str, environment: dict[str, str]) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run the installed command as a user types it."""

    def call(*arguments: object) -> subprocess.CompletedProcess[str]:
        words = [command, *(str(argument) for argument in arguments)]
        return subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE, env=environment)

    return call


@pytest.fixture
def type_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], str]:
    """Run a line of a page in `tmp_path`: `dovetail` in this process, which spares its start, all else in a shell.

    What it prints is returned. A line may end with a comment that names its exit code: ``# exit code 3``. Of a loop the
    shell says which commands it runs.
    """
    monkeypatch.chdir(tmp_path)
    path = f"{sysconfig.get_path('scripts')}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "OMP_NUM_THREADS": "1"}

    def typed(line: str) -> str:
        words = shlex.split(line, comments=True)
        code = int(line.rpartition("# exit code ")[2]) if "# exit code " in line else 0
        if words[0] == "dovetail":
            done = CliRunner().invoke(app, words[1:])
            assert done.exit_code == code, f"{line}\n{done.output}"
            return done.output
        loop = words[0] == "for"
        command = f"dovetail() {{ printf '%q ' dovetail \"$@\"; echo; }}\n{line}" if loop else line
        ran = subprocess.run(["bash", "-c", command], env=environment, capture_output=True, text=True)
        assert ran.returncode == code, f"{line}\n{ran.stderr}"
        return "".join(map(typed, ran.stdout.splitlines())) if loop else ran.stdout

    return typed


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory, assemblies: Path, run: Run) -> SimpleNamespace:
    """A small description, a measurement of it with k = 3 MN/m and c = 40 N s/m, its truth, and a model of it."""
    folder = tmp_path_factory.mktemp("bench")
    description, measured, truth = folder / "small.yaml", folder / "measured.uff", folder / "truth.json"
    description.write_text(SMALL.format(parent=assemblies / "sdof.yaml"))
    truth.write_text(json.dumps(TRUTH))
    run("simulate", description, "--set", "k=3 MN/m", "--set", "c=40", "-o", measured)
    trained = run("train", description, "-o", folder / "model")
    return SimpleNamespace(
        folder=folder, description=description, measured=measured, truth=truth, model=folder / "model", trained=trained
    )
