"""Syntax trees of source files, each made once in a process."""

from __future__ import annotations

import ast
import gc
from functools import cache
from pathlib import Path


@cache
def parsed(file: Path) -> ast.Module:
    """Return the syntax tree of a file.

    No garbage is collected meanwhile: a tree has no circles, and going through those made so far takes longer.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        return ast.parse(file.read_text(encoding="utf-8"))
    finally:
        if collects:
            gc.enable()


@cache
def nodes(file: Path) -> list[ast.AST]:
    """Return all nodes of the syntax tree of a file, outer ones first."""
    return list(ast.walk(parsed(file)))
