"""Scripts of this repository, run within the process of the tests."""

from __future__ import annotations

import contextlib
import io
import os
import runpy
import sys
from pathlib import Path
from unittest import mock


def run_script(path: Path, *arguments: object) -> str:
    """Run a script as by its command line, which spares the start of a process; return what it prints."""
    printed = io.StringIO()
    words = mock.patch.object(sys, "argv", [str(path), *map(str, arguments)])
    with words, mock.patch.dict(os.environ), contextlib.redirect_stdout(printed):
        runpy.run_path(str(path), run_name="__main__")
    return printed.getvalue()
