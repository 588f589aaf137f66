"""Files of time records in every format, with unit, quantity and times given in one of the ways of the format."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
import pyuff
from scipy.io import savemat

SAMPLES, RATE = 64, 2048.0
FORCE = np.where(np.arange(SAMPLES) == 8, 100.0, 0.0) + np.where(np.arange(SAMPLES) == 9, 40.0, 0.0)
RESPONSE = np.where(np.arange(SAMPLES) > 8, np.exp(-np.arange(SAMPLES) / 20) * np.sin(np.arange(SAMPLES)), 0.0)
SECONDS = {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6}
HERTZ = {"": 1.0, "Hz": 1.0, "kHz": 1e3}
NEWTONS = {"": 1.0, "N": 1.0, "lbf": 4.4482216152605, "kN": 1e3, "Newtons": 1.0}
MOTIONS = {
    "": ("accelerance", 1.0),
    "m/s^2": ("accelerance", 1.0),
    "g": ("accelerance", 9.80665),
    "mm/s^2": ("accelerance", 1e-3),
    "m/s": ("mobility", 1.0),
    "mm/s": ("mobility", 1e-3),
    "in/s": ("mobility", 0.0254),
    "m": ("receptance", 1.0),
    "um": ("receptance", 1e-6),
    "mil": ("receptance", 2.54e-5),
}
WORDS = {"accelerance": "acceleration", "mobility": "velocity", "receptance": "displacement"}
TYPES = {"displacement": 8, "velocity": 11, "acceleration": 12}


class Labels(NamedTuple):
    """What a file gives: units, the word for the motion, the times, and the numbers that go with them."""

    force: str = ""
    response: str = ""
    word: str = ""
    axis: str = "time"
    axis_unit: str = ""
    force_scale: float = 1.0
    response_scale: float = 1.0
    axis_scale: float = 1.0
    extra: tuple[tuple[str, object], ...] = ()

    @property
    def records(self) -> tuple[np.ndarray, np.ndarray]:
        return FORCE / self.force_scale, RESPONSE / self.response_scale

    @property
    def times(self) -> np.ndarray:
        return np.arange(SAMPLES) / RATE / self.axis_scale


def table(separator, style):
    def write(path: Path, labels: Labels) -> None:
        units = [labels.axis_unit, labels.force, labels.response]
        names = ["time", "force", f"response {labels.word}".strip()]
        above, below = [f"{key}: {value}" for key, value in labels.extra], []
        if style == "word only" and labels.word:
            names[2] = labels.word.capitalize()
        if style == "row":
            row = units if labels.axis == "time" else units[1:]
            below = [separator.join(row)] if any(row) else []
        elif style == "comment":
            above += [
                f"# {name} unit: {unit}"
                for name, unit in zip(("time", "force", "response"), units, strict=True)
                if unit
            ]
        else:
            form = {
                "bracket": "{} [{}]",
                "round": "{} ({})",
                "slash": "{} / {}",
                "suffix": "{}_{}",
                "word only": "{} [{}]",
            }[style]
            names = [form.format(name, unit) if unit else name for name, unit in zip(names, units, strict=True)]
        columns = [labels.times, *labels.records]
        if labels.axis != "time":
            names, columns = names[1:], columns[1:]
            above.append(
                f"# {'sampling rate' if labels.axis == 'rate' else 'dt'}: {axis_value(labels)!r} {labels.axis_unit}"
            )
        rows = [separator.join(f"{value:.12g}" for value in row) for row in zip(*columns, strict=True)]
        path.write_text("\n".join([*above, separator.join(names), *below, *rows]) + "\n")

    return write


def axis_value(labels: Labels) -> float:
    return RATE / labels.axis_scale if labels.axis == "rate" else 1.0 / RATE / labels.axis_scale


def fields_of(labels: Labels, style: str) -> dict[str, object]:
    """Names and arrays; units as entries of their own, as endings of the names, or in brackets."""
    force, response = labels.records
    names = [
        "force",
        f"response_{labels.word}" if labels.word else "response",
        {"time": "time", "rate": "rate", "step": "dt"}[labels.axis],
    ]
    units = [labels.force, labels.response, labels.axis_unit]
    values = [force, response, labels.times if labels.axis == "time" else axis_value(labels)]
    if style == "word only" and labels.word:
        names[1] = labels.word
    fields: dict[str, object] = {}
    for name, unit, value in zip(names, units, values, strict=True):
        full = f"{name}_{unit.replace('/', '_').replace('^', '')}" if unit and style == "suffix" else name
        fields[full] = value
        if unit and style != "suffix":
            fields[
                f"{name.partition('_')[0] if style != 'word only' else {names[1]: 'response'}.get(name, name)}_unit"
            ] = unit
    return fields | dict(labels.extra)


def npz(style):
    return lambda path, labels: np.savez(path, **fields_of(labels, style))


def structured(path: Path, labels: Labels) -> None:
    fields = fields_of(labels, "suffix")
    kinds = [(name, f"U{len(value)}" if isinstance(value, str) else "f8") for name, value in fields.items()]
    array = np.empty(SAMPLES, dtype=kinds)
    for name, value in fields.items():
        array[name] = value
    np.save(path, array)


def mat(style):
    def write(path: Path, labels: Labels) -> None:
        if style == "struct":
            force, response = labels.records
            signals = {
                "force": {"data": force, "unit": labels.force},
                "response": {"data": response, "unit": labels.response},
            }
            if labels.word:
                signals["response"]["quantity"] = labels.word
            axis = {"time": "time", "rate": "fs", "step": "dt"}[labels.axis]
            value = labels.times if labels.axis == "time" else axis_value(labels)
            signals[f"{axis}_{labels.axis_unit}" if labels.axis_unit else axis] = value
            savemat(path, {"Test": signals | dict(labels.extra)})
        else:
            savemat(path, {name[:31]: value for name, value in fields_of(labels, style).items()})

    return write


def hdf5(style):
    def write(path: Path, labels: Labels) -> None:
        force, response = labels.records
        with h5py.File(path, "w") as file:
            if style == "entry":
                for name, value in fields_of(labels, "entry").items():
                    file[name] = value
                return
            file["test/force"], file["test/response"] = force, response
            for name, unit in (("force", labels.force), ("response", labels.response)):
                if unit:
                    file[f"test/{name}"].attrs["units" if style == "plural" else "unit"] = unit
            if labels.word:
                file["test/response"].attrs["quantity"] = labels.word
            if labels.axis == "time":
                file["test/time"] = labels.times
                if labels.axis_unit:
                    file["test/time"].attrs["unit"] = labels.axis_unit
            else:
                key = {"rate": "sampling_rate", "step": "dt"}[labels.axis]
                key += f"_{labels.axis_unit}" if labels.axis_unit else ""
                target = file if style == "plural" else file["test/force"]
                target.attrs[key] = axis_value(labels)
            for key, value in labels.extra:
                file["test/response"].attrs[key] = value

    return write


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t.
Multi_Headings\tNo
X_Columns\t{columns}
Time_Pref\tRelative
Operator\tx
Date\t2024/01/01
Time\t10:00:00
***End_of_Header***\t

Channels\t2
Samples\t{n}\t{n}
Date\t2024/01/01\t2024/01/01
Time\t10:00:00\t10:00:00
{labels}X_Dimension\tTime\tTime
X0\t0\t0
Delta_X\t{step:.12E}\t{step:.12E}
***End_of_Header***\t\t\t
X_Value\t{force}\t{response}\tComment
{rows}
"""


def lvm(style):
    def write(path: Path, labels: Labels) -> None:
        force, response = "Force", (labels.word or "Response").capitalize()
        label_rows = f"X_Unit_Label\t{labels.axis_unit}\t{labels.axis_unit}\n" if labels.axis_unit else ""
        if style == "label" and (labels.force or labels.response):
            label_rows += f"Y_Unit_Label\t{labels.force}\t{labels.response}\n"
        else:
            force = f"{force} ({labels.force})" if labels.force else force
            response = f"{response} ({labels.response})" if labels.response else response
        first = [f"{value:.12g}" for value in labels.times] if labels.axis == "time" else [""] * SAMPLES
        rows = [f"{x}\t{a:.12g}\t{b:.12g}" for x, a, b in zip(first, *labels.records, strict=True)]
        columns = "One" if labels.axis == "time" else "No"
        step = 1.0 / RATE / labels.axis_scale
        texts = {"columns": columns, "labels": label_rows, "force": force, "response": response}
        path.write_text(LVM.format(n=SAMPLES, step=step, rows="\n".join(rows), **texts))

    return write


def uff_set(path: Path, kind: int, name: str, unit: str, samples: np.ndarray, labels: Labels, **other: object) -> None:
    one = {"type": 58, "func_type": 1, "rsp_node": 1, "rsp_dir": 3, "ref_node": 0, "ref_dir": 0, "x": labels.times}
    one |= {"data": samples, "abscissa_spec_data_type": 17, "abscissa_axis_lab": "Time", "binary": 0}
    one |= {"abscissa_axis_units_lab": labels.axis_unit or "NONE", "ordinate_spec_data_type": kind}
    one |= {"ordinate_axis_lab": name, "ordinate_axis_units_lab": unit or "NONE", "orddenom_spec_data_type": 0}
    pyuff.UFF(str(path)).write_sets(one | other, mode="add")


def uff(binary, style):
    def write(path: Path, labels: Labels) -> None:
        word = labels.word or WORDS[MOTIONS[labels.response][0]]
        kind = TYPES[word] if style == "type" else 0
        names = {"type": ("Force", word.capitalize()), "label": ("Force", word.capitalize()), "unit": ("NONE", "NONE")}[
            style
        ]
        forces = 13 if style == "type" else 0
        for role, name, unit, data in zip((forces, kind), names, labels[:2], labels.records, strict=True):
            uff_set(path, role, name, unit, data, labels, binary=binary)

    return write


WRITERS = {
    **{
        f"hit.csv {style}": table(",", style)
        for style in ("bracket", "round", "slash", "row", "suffix", "comment", "word only")
    },
    **{f"hit.tsv {style}": table("\t", style) for style in ("bracket", "row", "suffix")},
    **{f"hit.txt {style}": table(";", style) for style in ("round", "row", "comment")},
    **{f"hit.npz {style}": npz(style) for style in ("entry", "suffix", "word only")},
    "hit.npy suffix": structured,
    **{f"hit.mat {style}": mat(style) for style in ("entry", "suffix", "struct")},
    **{f"hit.h5 {style}": hdf5(style) for style in ("attribute", "plural", "entry")},
    **{f"hit.lvm {style}": lvm(style) for style in ("label", "bracket")},
    **{f"hit.uff ascii {style}": uff(0, style) for style in ("type", "label", "unit")},
    **{f"hit.uff binary {style}": uff(1, style) for style in ("type", "label", "unit")},
}
"""Format and way, and its writer."""
