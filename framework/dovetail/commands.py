"""What commands of packages are made of: shared options, reading of files, printing, files of results, exit codes."""

from __future__ import annotations

from dovetail.cli.terminal import print_json

__all__ = ["print_json"]
