"""Processes that a command has started end with it, however it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from support.waiting import PATIENCE, wait_until

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals are of POSIX")

POOL = """
import os, sys, time
from pathlib import Path
from dovetail.parallel import side_by_side

def work(index):
    Path(f"{os.getpid()}.child").touch()
    time.sleep(600)

list(side_by_side(work, 4, 2))
"""
GUARDED = """
from pathlib import Path
from dovetail.guarded_process import call_guarded
import endless

call_guarded(endless.read, Path("a.h5"), b"content", seconds=600.0)
"""
FRESH = """
import sys
from pathlib import Path
import endless
from dovetail.testing.fresh_process import run_in_fresh_process

run_in_fresh_process("endless", endless.Model, {}, Path("fresh"), {}, 600.0)
"""
ENDLESS = """
import os, time
from pathlib import Path

def read(*_):
    Path(__file__).with_name(f"{os.getpid()}.child").touch()
    time.sleep(600)

main = read

class Model:
    pass
"""
MEANWHILE = """
import os, time
from pathlib import Path
from dovetail.meanwhile import meanwhile

os.sched_getaffinity = lambda _: range(2)

def work():
    Path(f"{os.getpid()}.child").touch()
    time.sleep(600)

with meanwhile(work) as found:
    found()
"""
STARTERS = {
    "pool": (POOL, 2),
    "work meanwhile": (MEANWHILE, 1),
    "guarded process": (GUARDED, 1),
    "process of check-plugin": (FRESH, 1),
}


def is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
        return sys.platform != "linux" or ") Z " not in Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return False


@pytest.mark.parametrize("sign", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("kind", STARTERS)
def test_no_process_outlives_the_one_that_started_it(kind, sign, tmp_path):
    script, count = STARTERS[kind]
    if kind in ("pool", "work meanwhile") and sys.platform != "linux":
        pytest.skip("processes are forked on Linux only")
    (tmp_path / "endless.py").write_text(ENDLESS)
    (tmp_path / "fresh").mkdir()
    (tmp_path / "start.py").write_text(script)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    listening = (
        "import signal, runpy; signal.signal(signal.SIGINT, signal.default_int_handler); runpy.run_path('start.py')"
    )
    parent = subprocess.Popen([sys.executable, "-c", listening], cwd=tmp_path, env=environment, stderr=subprocess.PIPE)
    try:
        wait_until(lambda: len(list(tmp_path.glob("*.child"))) >= count, parent)
        children = [int(file.stem) for file in tmp_path.glob("*.child")]
    finally:
        parent.send_signal(sign)
    parent.communicate(timeout=PATIENCE)
    wait_until(lambda: not any(map(is_alive, children)))  # each would sleep for ten minutes
