"""Lengths of records that a file states are compared with its samples and its sampling rate, in every format."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import scipy.io

from dovetail.measurement.impact_test.signal_files import read_signals

RATE, SAMPLES, IMPACTS = 1024.0, 2048, 3
RIGHT = [
    ("record_length_s", 2.0),
    ("record_length_ms", 2000),
    ("RecordLength", 2.0),
    ("record length", 2048),
    ("block_duration", 1.999),
    ("n_samples", 2048),
    ("npts", IMPACTS * SAMPLES),
    ("BlockSize", 2048),
    ("sensor_length_m", 0.02),
    ("cable length", 5.0),
]
WRONG = [
    ("record_length_s", 4.0),
    ("record_length_ms", 2.0),
    ("RecordLength", 1.0),
    ("block length", 1024),
    ("frame_duration_s", 0.2),
    ("n_samples", 2),
    ("nsamples", 4096),
    ("blocksize", 512),
]


def signals():
    noise = np.random.default_rng(4).standard_normal((2, IMPACTS, SAMPLES))
    force = 1e-3 * noise[0]
    force[:, 20:26] += 1.0
    return force, 1e-3 * noise[1] + np.roll(force, 3, axis=1)


def npz(path, key, value):
    force, response = signals()
    np.savez(path, force=force, response=response, rate=RATE, **{key: value})


def mat(path, key, value):
    force, response = signals()
    scipy.io.savemat(path, {"force": force, "response": response, "rate": RATE, key.replace(" ", "_"): value})


def h5(path, key, value):
    force, response = signals()
    with h5py.File(path, "w") as file:
        file["force"], file["response"], file["rate"] = force, response, RATE
        file["force"].attrs[key] = value


def csv(path, key, value):
    force, response = signals()
    times = np.arange(SAMPLES) / RATE
    columns = np.column_stack([times, *np.stack([force, response], axis=1).reshape(-1, SAMPLES)])
    names = [f"{name} {impact}" for impact in range(1, IMPACTS + 1) for name in ("force", "response")]
    header = f"{key.replace('_', ' ')}: {value}\n{','.join(['time', *names])}"
    np.savetxt(path, columns, delimiter=",", header=header, comments="", fmt="%.9g")


@pytest.mark.parametrize("write", [npz, mat, h5, csv], ids=lambda write: write.__name__)
@pytest.mark.parametrize(("key", "value"), RIGHT)
def test_a_length_that_the_records_have_is_no_news(tmp_path, write, key, value):
    file = tmp_path / f"test.{write.__name__}"
    write(file, key, value)
    read = read_signals(file)
    assert (read.force.shape, read.rate) == ((IMPACTS, SAMPLES), pytest.approx(RATE))
    assert not read.warnings


@pytest.mark.parametrize("write", [npz, mat, h5, csv], ids=lambda write: write.__name__)
@pytest.mark.parametrize(("key", "value"), WRONG)
def test_a_length_that_the_records_do_not_have_is_reported(tmp_path, write, key, value):
    file = tmp_path / f"test.{write.__name__}"
    write(file, key, value)
    (warning,) = read_signals(file).warnings
    assert f"a length of {value:g}" in warning
    assert "the records have 2048 samples, 2 s at 1024 Hz" in warning


def test_a_number_that_is_no_length_is_left_alone(tmp_path):
    npz(tmp_path / "test.npz", "record length", "long")
    assert not read_signals(tmp_path / "test.npz").warnings
