"""A reader in a process of its own is given up for its processor time, not because the machine is busy."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from dovetail.errors import FileError
from dovetail.guarded_process import call_guarded

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows does not bound the processor time")
READERS = """
import time


def busy(*_):
    while True:
        pass


def waiting(*_):
    time.sleep(2.5)
    return {"answer": 1.0}


def endless(*_):
    time.sleep(600)
"""


@pytest.fixture
def readers(tmp_path, monkeypatch):
    (tmp_path / "timed_readers.py").write_text(READERS)
    monkeypatch.syspath_prepend(tmp_path)
    yield importlib.import_module("timed_readers")
    sys.modules.pop("timed_readers")


@pytest.mark.parametrize(("name", "seconds"), [("busy", 2.0), ("endless", 0.1)])
def test_a_reader_without_an_end_is_given_up(readers, name, seconds):
    with pytest.raises(FileError, match=f"reading it took more than {seconds:g} seconds"):
        call_guarded(getattr(readers, name), Path("a.h5"), b"", error=FileError, seconds=seconds)


def test_a_reader_that_waits_for_a_processor_is_not_given_up(readers):
    assert call_guarded(readers.waiting, Path("a.h5"), b"", error=FileError, seconds=2.0) == {"answer": 1.0}
