"""The ``dovetail`` command: arguments and printing; each command is a few calls of the API."""

from dovetail.cli.app import main

__all__ = ["main"]
