"""The choice of the reader for a file, by suffix and format, and the errors of its code."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import cast

from dovetail.errors import DovetailError, Fault, PluginError, listing
from dovetail.interfaces import FileReader, plugin_errors
from dovetail.registry.catalogue import Offer

HEAD = 4096
"""Number of bytes from which a reader recognises its format."""


def find_reader(
    path: Path, content: bytes, offers: Mapping[str, Sequence[Offer]], error: type[DovetailError]
) -> FileReader:
    """Return the reader that recognises a file, or else the default reader of its suffix.

    Parameters
    ----------
    path : Path
        With a suffix of `offers`.
    content : bytes
    offers : mapping of str to sequence of Offer
        Readers by the suffix of their files.
    error : type
        Of what is raised.

    Raises
    ------
    DovetailError
        Of the class `error`: none or several of them recognise it.
    PluginError
        The code of a reader fails.
    """
    suffix = path.suffix.lower()
    candidates = offers[suffix]
    takers = [
        offer for offer in candidates if suffix not in _reader_class(offer).default_for and _accepts(offer, content)
    ]
    takers = takers or [offer for offer in candidates if suffix in _reader_class(offer).default_for]
    if len(takers) > 1:
        remedy = "Say which by `reader=`."
        problem = "several readers take this file."
        raise error(Fault(str(path), problem, listing([o.qualified_name for o in takers]), remedy))
    if not takers:
        names = listing(offer.qualified_name for offer in candidates)
        problem = f"no reader of {suffix} files recognises the format of this one."
        raise error(Fault(str(path), problem, f"a file of one of the readers {names}"))
    return make_reader(takers[0])


def make_reader(offer: Offer) -> FileReader:
    """Return a reader.

    Raises
    ------
    PluginError
        Its constructor fails.
    """
    with plugin_errors(offer.component, f"reader '{offer.component.name}'"):
        return _reader_class(offer)()


def label_of(reader: FileReader) -> str:
    """Return what a reader is called in messages."""
    return f"reader '{reader.name}'"


@contextmanager
def refusals_reported(path: Path, reader: FileReader, error: type[DovetailError]) -> Iterator[None]:
    """Turn a ValueError, with which a reader refuses a file, into an error about the file.

    Raises
    ------
    DovetailError
        Of the class `error`.
    PluginError
        The code of the reader fails in another way.
    """
    try:
        with plugin_errors(reader, label_of(reader)):
            yield
    except PluginError as failure:
        if isinstance(failure.__cause__, ValueError):
            raise error(Fault(str(path), str(failure.__cause__))) from None
        raise


def _reader_class(offer: Offer) -> type[FileReader]:
    return cast("type[FileReader]", offer.component)


def _accepts(offer: Offer, content: bytes) -> bool:
    reader = make_reader(offer)
    with plugin_errors(reader, label_of(reader)):
        return bool(reader.sniff(content[:HEAD]))
