"""The files of one measurement whose responses are in several files: which belong together, by their names."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass

_WORD = re.compile(r"[A-Za-z0-9]+")


@dataclass(frozen=True)
class ResponseNames:
    """The words by which the names of the files of one measurement differ.

    Parameters
    ----------
    words : tuple of str
        One for each response, in order; lower case.
    """

    words: tuple[str, ...]

    @staticmethod
    def of(names: Sequence[str]) -> ResponseNames | None:
        """Return the words that differ in the names of files; None unless the names differ in one word only."""
        split = [[word.lower() for word in _WORD.findall(os.path.splitext(name)[0])] for name in names]
        if len({len(words) for words in split}) != 1:
            return None
        differing = [column for column in zip(*split, strict=True) if len(set(column)) > 1]
        if len(differing) != 1 or len(set(differing[0])) < len(names):
            return None
        return ResponseNames(tuple(differing[0]))

    def place(self, name: str) -> tuple[str, int] | None:
        """Return the name of the measurement to which a file belongs, and its response; None if no word is in it."""
        stem, end = os.path.splitext(name)
        for match in reversed(list(_WORD.finditer(stem))):
            if match[0].lower() in self.words:
                return f"{stem[: match.start()]}*{stem[match.end() :]}{end}", self.words.index(match[0].lower())
        return None
