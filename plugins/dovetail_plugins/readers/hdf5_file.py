"""The contents of HDF5 files, plain or as MATLAB 7.3 writes them; only imported by the guarded process."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import astuple
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dovetail import Fault, MeasurementError, damage_reported

if TYPE_CHECKING:
    import h5py

_LARGEST_ARRAY = 40_000_000
"""Largest size of an unpacked array in bytes."""
_SMALL_ARRAY = 16_000
"""Largest size in bytes of an array that is loaded to see what it states."""
_LARGEST_ANSWER = 64_000_000
"""Bytes of arrays that are returned at once; others are asked for by their names."""
_MOST_OBJECTS = 2000
_DEEPEST = 8
_LONGEST_TEXT = 4000
_MOST_TEXTS = 64
_NEEDED = ("unit", "units", "quantity", "MATLAB_class")
_STRUCTURAL = (
    *("DIMENSION_", "CLASS", "NAME", "REFERENCE_LIST", "H5PATH", "_Net", "_nc"),
    *("MATLAB_empty", "MATLAB_fields"),
)
"""Beginnings of attributes that describe the file's structure."""
_MOST_NUMBERS = 100
"""Numbers in an attribute, such as a gain for each channel."""
_COMPLEX = (("r", "i"), ("real", "imag"), ("re", "im"))


class _Contents:
    """What has been found: datasets by name with descriptions, classes of closed objects, and attributes."""

    def __init__(self, matlab: bool) -> None:
        self.matlab = matlab
        self.datasets: dict[str, h5py.Dataset] = {}
        self.entries: dict[str, tuple[str, Mapping[str, str], bool]] = {}
        self.closed: dict[str, str] = {}
        self.groups: dict[str, Mapping[str, str]] = {}
        self.count = 0


def hdf5_contents(path: Path, content: bytes, matlab: bool, names: Sequence[str] | None) -> dict[str, Any]:
    """Return the arrays of a file, its attributes, and why other arrays are not returned.

    Nothing outside the file is read: links to other files, external storage and virtual datasets are left out.

    Parameters
    ----------
    path : Path
    content : bytes
    matlab : bool
        Convert axes and texts to numpy's.
    names : sequence of str or None
        Of the arrays; None for all that fit into one answer.

    Raises
    ------
    MeasurementError
        The file is damaged, or larger than any FRF.
    """
    import h5py

    damage = damage_reported(str(path), "the HDF5 file is damaged or is none")  # OSError, RuntimeError and others
    with damage, h5py.File(io.BytesIO(content), "r") as file:
        contents = _Contents(matlab)
        _walk(path, file, "", 0, contents)
        answer: dict[str, Any] = {
            "entries": contents.entries,
            "closed": contents.closed,
            "attributes": _text_attributes(file),
            "groups": contents.groups,
            "faults": {},
        }
        size = 0
        for name, dataset in contents.datasets.items():
            size += (dataset.size or 0) * dataset.dtype.itemsize
            if (names is None and size <= _LARGEST_ANSWER) or (names is not None and name in names):
                try:
                    answer[f"array {name}"] = _array(path, dataset, matlab)
                except MeasurementError as error:
                    answer["faults"][name] = astuple(error.faults[0])
        return answer


def _walk(path: Path, group: h5py.Group, prefix: str, depth: int, contents: _Contents) -> None:
    """Collect the datasets of a group and of the groups in it."""
    import h5py

    for name in group:
        contents.count += 1
        if contents.count > _MOST_OBJECTS or depth > _DEEPEST:
            raise MeasurementError(Fault(str(path), "the file has more objects or deeper groups than any FRF."))
        if (contents.matlab and name.startswith("#")) or not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        item = group[name]
        if isinstance(item, h5py.Group):
            contents.groups[f"{prefix}{name}/"] = _text_attributes(item)
            _walk(path, item, f"{prefix}{name}/", depth + 1, contents)
        elif isinstance(item, h5py.Dataset) and not item.is_virtual and not item.external:
            _add_dataset(item, f"{prefix}{name}", contents)


def _add_dataset(item: h5py.Dataset, name: str, contents: _Contents) -> None:
    """Collect a dataset, or the datasets to which a MATLAB cell refers, numbered from 1."""
    import h5py

    attributes = _text_attributes(item)
    label = attributes.get("MATLAB_class", "") if contents.matlab else ""
    holds_references = h5py.check_ref_dtype(item.dtype) is h5py.Reference and 0 < (item.size or 0) <= _MOST_OBJECTS
    if contents.matlab and holds_references and label in ("cell", ""):
        folder, _, key = name.rpartition("/")  # each field of an array of structs is an array of references
        for number, reference in enumerate(item[()].ravel(), start=1):
            contents.count += 1
            target = item.file[reference] if reference else None
            if contents.count <= _MOST_OBJECTS and isinstance(target, h5py.Dataset) and not target.external:
                _add_dataset(
                    target, f"{name}{{{number}}}" if label == "cell" else f"{folder}({number})/{key}", contents
                )
        return
    if label and "MATLAB_object_decode" in item.attrs and label not in ("char", "logical"):
        contents.closed[name] = label
        return
    is_text = label == "char" or h5py.check_string_dtype(item.dtype) is not None
    what = "text" if is_text else f"{item.shape} {item.dtype}"
    contents.datasets[name] = item
    contents.entries[name] = (what, attributes, (item.size or 0) * item.dtype.itemsize <= _SMALL_ARRAY)


def _array(path: Path, dataset: h5py.Dataset, matlab: bool) -> NDArray[Any]:
    """Return the numbers or the text of a dataset, if its header shows that it is small."""
    import h5py

    size = int(np.prod(dataset.shape or (1,), dtype=np.float64)) * dataset.dtype.itemsize
    if size > _LARGEST_ARRAY:
        accepted = f"at most {_LARGEST_ARRAY // 1_000_000} MB"
        raise MeasurementError(Fault(str(path), f"'{dataset.name[1:]}' unpacks to {size / 1e6:.0f} MB.", accepted))
    if h5py.check_string_dtype(dataset.dtype) is not None:
        if dataset.shape == ():
            return np.array(_decode_text(dataset[()]))
        texts = dataset[:_MOST_TEXTS]
        return np.array([_decode_text(text) for text in texts.reshape(-1)]).reshape(texts.shape)
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
        elif value.dtype.kind == "b" and value.size == 1:
            texts[str(name)] = str(bool(value[0]))
        elif 1 < value.size <= _MOST_TEXTS and all(isinstance(one, str | bytes) for one in value):
            texts[str(name)] = ", ".join(_decode_text(one) for one in value)
        elif value.size == 1 and isinstance(value[0], str | bytes):
            texts[name.lower() if name.lower() in _NEEDED else str(name)] = _decode_text(value[0])
    return texts


def _decode_text(value: object) -> str:
    text = value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value)
    return text[:_LONGEST_TEXT]
