"""FRFs in HDF5 files, plain or as MATLAB 7.3 writes them."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, damage_reported
from dovetail.measurement.formats.archives import LARGEST_ARRAY, SMALL_ARRAY, Archive, Entry
from dovetail.measurement.formats.frd import closed_entry, with_frd_units

if TYPE_CHECKING:
    import h5py

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_STARTS = (0, *(512 << power for power in range(18)))
_MOST_OBJECTS = 2000
_DEEPEST = 8
_LONGEST_TEXT = 4000
_MOST_TEXTS = 64
_CLOSED = "class of an object that only MATLAB opens"
"""Attribute of such an entry, with the name of the class."""
_NEEDED = ("unit", "units", "quantity", "MATLAB_class")
_STRUCTURAL = (
    "DIMENSION_",
    "CLASS",
    "NAME",
    "REFERENCE_LIST",
    "H5PATH",
    "_Net",
    "_nc",
    "MATLAB_empty",
    "MATLAB_fields",
)
"""Beginnings of attributes that describe the file's structure."""
_MOST_NUMBERS = 100
"""Numbers in an attribute, such as a gain for each channel."""
_COMPLEX = (("r", "i"), ("real", "imag"), ("re", "im"))


def check_signature(path: Path, content: bytes) -> None:
    """Raise a MeasurementError if a file is not HDF5."""
    if not any(content.startswith(SIGNATURE, start) for start in _STARTS):
        raise MeasurementError(Fault(str(path), "this is no HDF5 file."))


@contextmanager
def open_hdf5(path: Path, content: bytes, *, matlab: bool) -> Iterator[Archive]:
    """Open an HDF5 file, only in the guarded process; with `matlab`, axes and texts are converted to numpy's.

    Nothing outside the file is read: links to other files, external storage and virtual datasets are left out.

    Raises
    ------
    MeasurementError
        The file is damaged, or larger than any FRF.
    """
    import h5py

    damage = damage_reported(str(path), "the HDF5 file is damaged or is none")  # OSError, RuntimeError and others
    with damage, h5py.File(io.BytesIO(content), "r") as file:
        groups: dict[str, Mapping[str, str]] = {}
        entries = dict(_entries(path, file, "", 0, [0], matlab, groups))
        if matlab:
            labels = {name: label for name, entry in entries.items() if (label := entry.attributes.get(_CLOSED))}
            entries = with_frd_units(path, {name: entries[name] for name in entries if name not in labels}, "/")
            entries |= {name: closed_entry(path, name, label, entries) for name, label in labels.items()}
        yield Archive(path, entries, _text_attributes(file), groups)


def _entries(
    path: Path,
    group: h5py.Group,
    prefix: str,
    depth: int,
    count: list[int],
    matlab: bool,
    groups: dict[str, Mapping[str, str]],
) -> Iterator[tuple[str, Entry]]:
    import h5py

    for name in group:
        count[0] += 1
        if count[0] > _MOST_OBJECTS or depth > _DEEPEST:
            raise MeasurementError(Fault(str(path), "the file has more objects or deeper groups than any FRF."))
        if (matlab and name.startswith("#")) or not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        item = group[name]
        if isinstance(item, h5py.Group):
            groups[f"{prefix}{name}/"] = _text_attributes(item)
            yield from _entries(path, item, f"{prefix}{name}/", depth + 1, count, matlab, groups)
        elif isinstance(item, h5py.Dataset) and not item.is_virtual and not item.external:
            yield from _dataset_entries(path, item, f"{prefix}{name}", matlab, count)


def _dataset_entries(
    path: Path, item: h5py.Dataset, name: str, matlab: bool, count: list[int]
) -> Iterator[tuple[str, Entry]]:
    """Yield a dataset, or the datasets to which a MATLAB cell refers, numbered from 1."""
    import h5py

    attributes = _text_attributes(item)
    label = attributes.get("MATLAB_class", "") if matlab else ""
    holds_references = h5py.check_ref_dtype(item.dtype) is h5py.Reference and 0 < (item.size or 0) <= _MOST_OBJECTS
    if matlab and holds_references and label in ("cell", ""):
        folder, _, field = name.rpartition("/")  # each field of an array of structs is an array of references
        for number, reference in enumerate(item[()].ravel(), start=1):
            count[0] += 1
            target = item.file[reference] if reference else None
            if count[0] <= _MOST_OBJECTS and isinstance(target, h5py.Dataset) and not target.external:
                element = f"{name}{{{number}}}" if label == "cell" else f"{folder}({number})/{field}"
                yield from _dataset_entries(path, target, element, matlab, count)
        return
    if label and "MATLAB_object_decode" in item.attrs and label not in ("char", "logical"):
        attributes = {_CLOSED: label}
    is_text = label == "char" or h5py.check_string_dtype(item.dtype) is not None
    what = "text" if is_text else f"{item.shape} {item.dtype}"
    is_small = (item.size or 0) * item.dtype.itemsize <= SMALL_ARRAY
    yield name, Entry(what, partial(_array, path, item, matlab), attributes, is_small)


def _array(path: Path, dataset: h5py.Dataset, matlab: bool) -> NDArray[Any]:
    """Return the numbers or the text of a dataset, if its header shows that it is small."""
    import h5py

    size = int(np.prod(dataset.shape or (1,), dtype=np.float64)) * dataset.dtype.itemsize
    if size > LARGEST_ARRAY:
        accepted = f"at most {LARGEST_ARRAY // 1_000_000} MB"
        raise MeasurementError(Fault(str(path), f"'{dataset.name[1:]}' unpacks to {size / 1e6:.0f} MB.", accepted))
    if h5py.check_string_dtype(dataset.dtype) is not None:
        if dataset.shape == ():
            return np.array(_decode_text(dataset[()]))
        return np.array(", ".join(_decode_text(text) for text in dataset[:_MOST_TEXTS].reshape(-1)[:_MOST_TEXTS]))
    if dataset.dtype.hasobject or dataset.shape is None:
        raise MeasurementError(Fault(str(path), f"'{dataset.name[1:]}' holds references, not numbers or text."))
    array = np.asarray(dataset[()])
    if matlab and _text_attributes(dataset).get("MATLAB_class") == "char":
        return np.array("".join(map(chr, array.T.ravel()[:_LONGEST_TEXT].tolist())))
    if array.dtype.names in _COMPLEX:
        real, imaginary = array.dtype.names
        array = array[real] + 1j * array[imaginary]
    return array.T if matlab else array


def _text_attributes(item: h5py.Group | h5py.Dataset) -> Mapping[str, str]:
    """Return the attributes that are texts, and numbers as texts."""
    texts = {}
    for name in list(item.attrs)[:50]:
        if name.startswith(_STRUCTURAL):
            continue
        try:
            value = np.ravel(item.attrs[name])
        except Exception:  # one of a type that cannot be read says nothing, unless the numbers depend on it
            if name in _NEEDED:
                raise
            continue
        if 0 < value.size <= _MOST_NUMBERS and value.dtype.kind in "fiu":
            texts[str(name)] = "; ".join(f"{number:.10g}" for number in value)
        elif value.size == 1 and isinstance(value[0], str | bytes):
            texts[name.lower() if name.lower() in _NEEDED else str(name)] = _decode_text(value[0])
    return texts


def _decode_text(value: object) -> str:
    text = value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value)
    return text[:_LONGEST_TEXT]
