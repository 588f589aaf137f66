"""Completion in real shells, as far as they are installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sysconfig

import pytest

SCRIPTS = sysconfig.get_path("scripts")

IN_BASH = """
source <(dovetail --show-completion bash)
COMP_WORDS=({words}) COMP_CWORD={last}
_dovetail_completion dovetail
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
IN_ZSH = """
autoload -Uz compinit && compinit -u
compdef() {{ }}
_arguments() {{ print -l -- "${{@}}" }}
_files() {{ print -- FILES }}
eval "$(dovetail --show-completion zsh)"
words=({words}) CURRENT={count}
_dovetail_completion
"""
IN_FISH = """
dovetail --show-completion fish | source
complete --do-complete {line}
"""


def completed(shell: str, line: list[str], folder) -> str:
    """Return what a shell offers for the last word of a command line."""
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    quoted = " ".join(f"'{word}'" for word in line)
    script = {"bash": IN_BASH, "zsh": IN_ZSH, "fish": IN_FISH}[shell].format(
        words=quoted, last=len(line) - 1, count=len(line), line="'" + " ".join(line) + "'"
    )
    environment = {**os.environ, "PATH": f"{SCRIPTS}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(
        [shell, "-c", script], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


LINES = {
    "command": (["dovetail", "ident"], ["identify"], ["simulate"]),
    "model": (["dovetail", "describe", "timo"], ["timoshenko_beam"], ["collet"]),
    "parameter": (["dovetail", "simulate", "sdof.yaml", "--set", ""], ["k=", "c="], ["Dc="]),
    "file": (["dovetail", "identify", "sdof.yaml", "mea"], ["measured.uff"], ["sdof.yaml"]),
    "method": (["dovetail", "identify", "sdof.yaml", "measured.uff", "--method", "re"], ["refined"], ["network"]),
}
EVERYWHERE = ("command", "file")
"""What every shell is asked by default; bash is asked everything."""


@pytest.mark.sweep(keep=5)
@pytest.mark.parametrize(
    ("shell", "line", "offered", "others"),
    [
        pytest.param(
            shell, *case, id=f"{name}-{shell}", marks=[pytest.mark.slow] * (shell != "bash" and name not in EVERYWHERE)
        )
        for name, case in LINES.items()
        for shell in ("bash", "zsh", "fish")
    ],
)
def test_a_shell_completes(shell, line, offered, others, assemblies, tmp_path):
    shutil.copy(assemblies / "sdof.yaml", tmp_path)
    (tmp_path / "measured.uff").touch()
    printed = completed(shell, line, tmp_path)
    assert all(word in printed for word in offered), printed
    assert not any(word in printed for word in others), printed
