"""Archives with the receptance of a measured part: wrong signs and contradictory frequencies are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dovetail

FREQUENCY = np.arange(50.0, 500.0, 5.0)
OMEGA = 2 * np.pi * FREQUENCY
SHAPES = np.array([[1.0, 0.8], [1.0, -0.9]])
POLES = np.array([(2 * np.pi * natural) ** 2 * (1 + 0.02j) for natural in (120.0, 300.0)])
RECEPTANCE = np.einsum("mi,mj,fm->fij", SHAPES, SHAPES, 1.0 / (POLES - OMEGA[:, np.newaxis] ** 2))


def load(folder: Path, **entries: Any) -> dovetail.Assembly:
    """An assembly with the part, to whose right end a mass is attached."""
    arrays = {
        "frequency": FREQUENCY, "receptance": RECEPTANCE, "positions": np.array([0.0, 0.4]),
        "nodes": np.array(["left", "right"]), "directions": np.array(["x", "x"]),
    }  # fmt: skip
    np.savez(folder / "part.npz", **{**arrays, **entries})
    connect = {"a": {"to": "tip", "at": 0}, "b": {"to": "frame", "at": "node right"}}
    spring = {"k": {"value": 1e5}, "c": {"value": 10.0}}
    return dovetail.load(
        {
            "dovetail": 1,
            "name": "measured part",
            "frequency": {"start": 50.0, "stop": 490.0, "step": 10.0},
            "substructures": {
                "frame": {"model": "measured", "file": str(folder / "part.npz")},
                "tip": {"model": "lumped", "masses": [{"mass": 0.3}]},
            },
            "joints": {"j": {"model": "spring_damper", "direction": "x", "connect": connect, "parameters": spring}},
            "response": {"at": "frame", "position": "node left", "quantity": "receptance"},
        }
    )


NOISE = np.random.default_rng(0).standard_normal((2, *RECEPTANCE.shape))
NOISY = RECEPTANCE * (1 + 0.1 * (NOISE[0] + 1j * NOISE[1]))
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "reversed sign": ({"receptance": -RECEPTANCE}, "delivers 100 % of the power"),
    "conjugated": ({"receptance": RECEPTANCE.conj()}, "delivers 100 % of the power"),
    "one reversed": ({"receptance": RECEPTANCE * np.array([[1, 1], [1, -1]])}, "the receptance of right x"),
    "other axis": ({"omega": FREQUENCY}, "'omega'"),
    "other axis in kHz": ({"f_kHz": FREQUENCY}, "'f_kHz'"),
    "other step": ({"df": 2.0}, "'df' = 2"),
}


@pytest.mark.parametrize("fault", WRONG)
def test_a_receptance_of_a_wrong_sign_or_axis_is_refused(tmp_path: Path, fault: str) -> None:
    entries, said = WRONG[fault]
    with pytest.raises(dovetail.DescriptionError, match=said):
        load(tmp_path, **entries)


@pytest.mark.parametrize("entries", [{}, {"omega": OMEGA}, {"df": 5.0}, {"receptance": NOISY}], ids=str)
def test_a_sound_receptance_is_read_without_a_warning(
    tmp_path: Path, entries: dict[str, Any], recwarn: pytest.WarningsRecorder
) -> None:
    assert load(tmp_path, **entries).frf().shape == (45,)
    assert not recwarn


def test_exchanged_rows_are_reported(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="of the power, which no passive structure does"):
        load(tmp_path, receptance=RECEPTANCE[:, ::-1])
