"""Features that Windows and macOS lack are used only behind a check; this inspects the source code alone."""

from __future__ import annotations

import ast
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from dovetail import atomic_files
from support.syntax_trees import nodes, parsed

FILES = sorted(
    file for folder in ("framework", "plugins") for file in (Path(__file__).parents[2] / folder).rglob("*.py")
)
MODULES = frozenset(("fcntl", "grp", "msvcrt", "pty", "pwd", "resource", "termios", "tty", "winreg"))
SIGNALS = frozenset(("SIGABRT", "SIGFPE", "SIGILL", "SIGINT", "SIGSEGV", "SIGTERM", "SIG_DFL", "SIG_IGN"))
"""Those that Windows has."""
OF_LINUX = frozenset(
    (
        *("fork", "forkpty", "geteuid", "getpgid", "getuid", "killpg", "mkfifo", "nice", "posix_spawn", "setsid"),
        *("sched_getaffinity", "statvfs", "sysconf", "umask", "uname", "wait4", "waitid", "waitpid"),
        *("O_DIRECTORY", "O_NOFOLLOW"),
    )
)
"""Of the module os."""


def imports(node: ast.AST) -> Iterator[str]:
    """Yield the modules that a piece of code imports where nothing catches an ImportError."""
    if isinstance(node, ast.Try) and any("ImportError" in ast.unparse(h.type) for h in node.handlers if h.type):
        return
    if isinstance(node, ast.Import):
        yield from (name.name for name in node.names)
    if isinstance(node, ast.ImportFrom) and node.module and not node.level:
        yield node.module
    for child in ast.iter_child_nodes(node):
        yield from imports(child)


@pytest.mark.parametrize("folder", ["framework", "plugins"])
def test_no_module_is_imported_that_a_system_lacks(folder: str) -> None:
    files = [file for file in FILES if folder in file.parts]
    assert files
    assert {file.name: found for file in files if (found := MODULES.intersection(imports(parsed(file))))} == {}


def test_no_signal_and_no_call_is_used_that_a_system_lacks() -> None:
    used = {
        f"{file.name}:{node.lineno} {node.value.id}.{node.attr}"
        for file in FILES
        for node in nodes(file)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
        if (node.value.id == "os" and node.attr in OF_LINUX)
        or (
            node.value.id == "signal"
            and hasattr(signal, node.attr)
            and node.attr[:3] == "SIG"
            and node.attr not in SIGNALS
        )
    }
    assert used == set()


def test_pathlib_asks_windows_for_no_mounts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """There `Path.is_mount` raises NotImplementedError before Python 3.12."""

    def missing(self: Path) -> bool:
        raise NotImplementedError

    monkeypatch.setattr(Path, "is_mount", missing)
    with atomic_files.new_folder(tmp_path / "results") as fresh:
        (fresh / "a").touch()
    atomic_files.check_target(tmp_path / "results")


def test_the_listed_names_exist_on_this_system() -> None:
    """A misspelt name would never be found."""
    if os.name == "posix":
        assert {name for name in OF_LINUX if not hasattr(os, name)} <= {"sched_getaffinity"}
        assert {name for name in SIGNALS if not hasattr(signal, name)} == set()
