"""FRFs in numpy archives, read without pickle."""

from __future__ import annotations

import io
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError, did_you_mean, listing
from dovetail.frf import Frf, Quantity
from dovetail.measurement.recording import MOST_LINES, Recording, known_quantity

__all__ = ["decode", "encode"]

_NAMES = ("frequency", "values", "amplitude", "coherence", "quantity")
_LARGEST_DIRECTORY = 65536
"""Bytes of the archive's directory: room for hundreds of arrays, not for millions of empty ones."""
_LARGEST_ARRAY = 40_000_000
"""Bytes of one unpacked array; the archive cannot unpack more than it declares."""
_WIDEST_ITEM = 400
"""Bytes of one array item: a complex number, or a word of 100 characters."""


def decode(path: Path, content: bytes, _index: int | None) -> Recording:
    """Return what an NPZ file holds.

    Raises
    ------
    MeasurementError
        Not an archive, missing or misshapen arrays, Python objects.
    """
    arrays = _arrays(path, content)
    frequency = _line_array(path, arrays, "frequency", "real")
    has_phase = "values" in arrays
    if has_phase == ("amplitude" in arrays):
        which = "both values and amplitude" if has_phase else "neither values nor amplitude"
        raise MeasurementError(Fault(str(path), f"the archive holds {which}.", "values (complex) or amplitude (real)"))
    name, kind = ("values", "complex") if has_phase else ("amplitude", "real")
    values = _line_array(path, arrays, name, kind)
    coherence = _line_array(path, arrays, "coherence", "real") if "coherence" in arrays else None
    for other, array in ((name, values), ("coherence", coherence)):
        if array is not None and array.size != frequency.size:
            raise MeasurementError(
                Fault(str(path), f"'{other}' has {array.size} lines, 'frequency' has {frequency.size}.")
            )
    quantity = _quantity(path, arrays)
    return Recording(
        where=str(path),
        label=path.name,
        frequency=frequency,
        values=values,
        has_phase=has_phase,
        quantity=quantity,
        is_stated=quantity is not None,
        coherence=coherence,
        place=lambda index: f"{path}  line {index + 1} of the arrays",
        how_to_state_quantity="an array 'quantity' with the word",
    )


def encode(frf: Frf, path: Path, _binary: bool | None) -> bytes:
    """Return an NPZ file.

    Raises
    ------
    MeasurementError
        A coherence that is not finite.
    """
    arrays: dict[str, NDArray[Any]] = {"frequency": frf.frequency, "quantity": np.array(frf.quantity)}
    arrays |= {"values": frf.values} if frf.has_phase else {"amplitude": frf.amplitude}
    if frf.coherence is not None:
        if not np.all(np.isfinite(frf.coherence)):
            raise MeasurementError(Fault(str(path), f"the coherence of {frf.label} is not finite: nothing is written."))
        arrays["coherence"] = frf.coherence
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **arrays)
    return stream.getvalue()


def _arrays(path: Path, content: bytes) -> dict[str, NDArray[Any]]:
    """Return the arrays that an FRF has; any other stays unread."""
    if _directory_size(content) > _LARGEST_DIRECTORY:
        raise MeasurementError(Fault(str(path), "the archive's directory is larger than that of any FRF."))
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            held = [name.removesuffix(".npy") for name in archive.namelist()]
            arrays = {name: _array(path, archive, name) for name in _NAMES if name in held}
    except MeasurementError:
        raise
    except Exception as error:  # zipfile, its decompressors and numpy's header parser each raise their own
        raise MeasurementError(
            Fault(
                str(path), f"the archive is damaged: {str(error)[:100] or type(error).__name__}.", "a file of np.savez"
            )
        ) from None
    if "frequency" not in arrays:
        near = did_you_mean("frequency", held)
        raise MeasurementError(
            Fault(str(path), f"there is no array 'frequency'; there is: {listing(held) or 'nothing'}.", remedy=near)
        )
    return arrays


def _directory_size(content: bytes) -> int:
    """Size that the end record of a zip file gives its directory; 0 where there is no such record."""
    end = content.rfind(b"PK\x05\x06")
    if end < 0 or len(content) < end + 22:
        return 0
    return int(struct.unpack_from("<I", content, end + 12)[0])


def _array(path: Path, archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """Return one array after its header has shown that it is small and holds plain values."""
    size = archive.getinfo(f"{name}.npy").file_size
    if size > _LARGEST_ARRAY:
        raise MeasurementError(
            Fault(str(path), f"'{name}' unpacks to {size / 1e6:.0f} MB.", f"at most {_LARGEST_ARRAY // 1_000_000} MB")
        )
    with archive.open(f"{name}.npy") as stream:
        shape, dtype = _header(path, stream, name)
    if dtype.hasobject:
        raise MeasurementError(
            Fault(str(path), f"'{name}' holds Python objects (pickle), which are never loaded.", "an array of numbers")
        )
    if any(length > MOST_LINES for length in shape) or len(shape) > 1 or dtype.itemsize > _WIDEST_ITEM:
        raise MeasurementError(
            Fault(
                str(path),
                f"'{name}' has the shape {shape} of {dtype.itemsize} bytes each.",
                f"the shape (n_freq,), at most {MOST_LINES:,} lines",
            )
        )
    with archive.open(f"{name}.npy") as stream:
        return np.asarray(np.lib.format.read_array(stream, allow_pickle=False))


def _header(path: Path, stream: Any, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        shape, _, dtype = np.lib.format.read_array_header_1_0(stream)
    elif version == (2, 0):
        shape, _, dtype = np.lib.format.read_array_header_2_0(stream)
    else:
        raise MeasurementError(Fault(str(path), f"'{name}' has the array format {version}.", "format 1.0 or 2.0"))
    return shape, dtype


def _line_array(path: Path, arrays: dict[str, NDArray[Any]], name: str, kind: str) -> NDArray[Any]:
    array = arrays[name]
    accepted = {"real": "fiu", "complex": "c"}[kind]
    if array.ndim != 1 or array.size == 0 or array.dtype.kind not in accepted:
        raise MeasurementError(
            Fault(
                str(path),
                f"'{name}' has the shape {array.shape} and the type {array.dtype}.",
                f"(n_freq,) {kind} numbers",
            )
        )
    return array.astype(np.complex128 if kind == "complex" else np.float64)


def _quantity(path: Path, arrays: dict[str, NDArray[Any]]) -> Quantity | None:
    if "quantity" not in arrays:
        return None
    array = arrays["quantity"]
    if array.size != 1 or array.dtype.kind not in "US":
        raise MeasurementError(Fault(f"{path}  quantity", "the array is not one word."))
    word = array.reshape(())[()]
    text = word.decode("ascii", errors="replace") if isinstance(word, bytes) else str(word)
    return known_quantity(text, f"{path}  quantity")
