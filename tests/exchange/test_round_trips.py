"""What other packages get is the same when it comes back, with its units."""

from __future__ import annotations

import json
import sys
from dataclasses import fields

import numpy as np
import pytest

import dovetail
from support.small_joints import ASSEMBLIES

TRUTH = {"k": 2.5e6, "c": 40.0}
FREQUENCY = np.arange(5.0, 105.0, 5.0)


@pytest.fixture(scope="module")
def sdof():
    return dovetail.load(ASSEMBLIES / "sdof.yaml")


@pytest.fixture(scope="module")
def result(sdof):
    return dovetail.identify(sdof, dovetail.noisy_frf(sdof.simulate(TRUTH), 0.01, 0), samples=60)


def frf(**changed):
    random = np.random.default_rng(0)
    values = random.standard_normal(len(FREQUENCY)) + 1j * random.standard_normal(len(FREQUENCY))
    return dovetail.Frf(FREQUENCY, values, **{"quantity": "mobility", **changed})


def assert_equal(first, second):
    for field in fields(first):
        np.testing.assert_equal(getattr(second, field.name), getattr(first, field.name), field.name)


FRFS = {
    "plain": {},
    "measured": {
        "coherence": np.linspace(0.5, 1.0, 20),
        "averages": 5,
        "label": "a.uff",
        "note": "what \N{MICRO SIGN}",
    },
    "known variance": {"variance": np.linspace(1e-6, 1e-5, 20), "response": "5+x", "force": "3-y"},
    "rotation": {"rotation": True, "quantity": "receptance"},
    "by moment": {"rotation": False, "moment": True, "quantity": "accelerance"},
}


@pytest.mark.parametrize("name", FRFS)
def test_an_frf_comes_back_from_xarray(name, tmp_path):
    pytest.importorskip("xarray")
    original = frf(**FRFS[name])
    arrays = dovetail.to_xarray(original)
    assert arrays["frf"].dims == ("frequency",)
    assert arrays["frf"].attrs["units"] == original.unit
    assert arrays["frequency"].attrs["units"] == "Hz"
    assert_equal(original, dovetail.from_xarray(arrays))
    arrays.to_zarr(tmp_path / "frf.zarr")
    stored = sys.modules["xarray"].open_zarr(tmp_path / "frf.zarr")
    assert_equal(original, dovetail.from_xarray(stored))


def test_amplitudes_come_back_from_xarray():
    original = dovetail.Frf(FREQUENCY, np.ones(20), "receptance", has_phase=False)
    assert_equal(original, dovetail.from_xarray(dovetail.to_xarray(original)))


@pytest.mark.parametrize("form", ["samples", "laplace"])
def test_a_posterior_comes_back_from_xarray(sdof, form):
    posterior = dovetail.identify(sdof, dovetail.noisy_frf(sdof.simulate(TRUTH), 0.01, 0), form=form).posterior
    arrays = dovetail.to_xarray(posterior)
    assert arrays["theta"].dims == ("sample", "parameter")
    again = dovetail.from_xarray(arrays)
    assert_equal(posterior, again)
    assert again.interval() == posterior.interval()


def test_a_result_comes_back_from_xarray(result, tmp_path):
    tree = dovetail.to_xarray(result)
    assert list(tree["parameters"]["unit"].to_numpy()) == ["N/m", "N s/m"]
    assert float(tree["parameters"]["estimate"].sel(parameter="k")) == result.table[0].estimate
    assert_equal(result.measured, dovetail.from_xarray(tree["responses/0/measured"]))
    assert list(tree["posterior"]["unit"].to_numpy()) == ["N/m", "N s/m"]
    (tmp_path / "result.json").write_text(json.dumps(result.to_dict()))
    written = dovetail.load_result(tmp_path / "result.json").to_dict()
    assert dovetail.from_xarray(tree).to_dict() == written
    assert written["fit"] == result.to_dict()["fit"]
    assert dovetail.from_xarray(dovetail.to_xarray(dovetail.from_xarray(tree))).is_fitted
    tree.to_zarr(tmp_path / "result.zarr")
    stored = dovetail.from_xarray(sys.modules["xarray"].open_datatree(tmp_path / "result.zarr", engine="zarr"))
    assert stored.to_dict() == written


def test_a_dataset_has_labelled_arrays_in_xarray(sdof, tmp_path):
    for storage, name in (("amplitude", "amplitude"), ("complex", "accelerance")):
        dataset = dovetail.generate(sdof, tmp_path / storage, samples=6, storage=storage)
        arrays = dovetail.to_xarray(dataset)
        assert arrays[name].dims == ("sample", "response", "frequency")
        assert arrays[name].attrs["units"] == "m/(N s^2)"
        assert list(arrays["unit"].to_numpy()) == ["N/m", "N s/m"]
        np.testing.assert_array_equal(arrays[name].to_numpy()[:, 0], getattr(dataset, name)[:])
        np.testing.assert_array_equal(arrays["theta"].sel(parameter="c"), dataset.parameters[:, 1])


def test_modes_have_labelled_arrays_in_xarray(sdof, result):
    arrays = dovetail.to_xarray(dovetail.modes(sdof, result))
    assert arrays["natural_frequency"].attrs["units"] == "Hz"
    assert list(arrays["end"].to_numpy()) == ["low", "high"]
    with pytest.raises(dovetail.DovetailError, match="Modes is not restored"):
        dovetail.from_xarray(arrays)


def test_what_has_no_labelled_arrays_is_refused(sdof):
    with pytest.raises(dovetail.DovetailError, match="an object of the type Assembly has no labelled arrays"):
        dovetail.to_xarray(sdof)
    with pytest.raises(dovetail.DovetailError, match="not made by 'to_xarray'"):
        dovetail.from_xarray(3)


def test_an_frf_comes_back_from_the_names_of_sdypy():
    original = frf()
    named = dovetail.to_sdypy(original)
    assert set(named) == {"frf", "freq", "frf_form"}
    (again,) = dovetail.from_sdypy(**named)
    np.testing.assert_array_equal(again.values, original.values)
    assert again.quantity == original.quantity
    with_zero = dovetail.from_sdypy(np.ones((2, 3)), [0.0, 1.0, 2.0], "receptance")
    assert [len(each.frequency) for each in with_zero] == [2, 2]
    with pytest.raises(dovetail.MeasurementError, match="do not fit"):
        dovetail.from_sdypy(np.ones((2, 3)), [1.0, 2.0])
    with pytest.raises(dovetail.MeasurementError, match="'inertance' is not a form"):
        dovetail.from_sdypy(np.ones(3), [1.0, 2.0, 3.0], "inertance")


@pytest.fixture(scope="module")
def hits():
    time = np.arange(1024) / 2048
    pulse = np.where(time < 0.004, np.sin(np.pi * time / 0.004), 0.0)
    return np.stack([pulse, 2 * pulse]), np.exp(-20 * time) * np.sin(2 * np.pi * 200 * time) * [[1.0], [2.0]]


def test_signals_in_the_form_of_sep_5_give_the_same_frf(hits):
    pytest.importorskip("pyFRF")
    force, response = hits
    expected = dovetail.frf_from_signals(force, response, 2048.0, quantity="mobility")
    signals = dovetail.to_sep005(force, response, 2048.0, quantity="mobility")
    again = dovetail.from_sep005(signals)
    np.testing.assert_array_equal(again.frf.values, expected.frf.values)
    assert again.frf.quantity == "mobility"
    timed = [{**signal, "fs": None, "time": np.arange(1024) / 2048} for signal in signals]
    np.testing.assert_allclose(dovetail.from_sep005(timed).frf.values, expected.frf.values, rtol=1e-9)
    kilonewton = [{**s, "data": s["data"] / 1e3, "unit_str": "kN"} if s["unit_str"] == "N" else s for s in signals]
    np.testing.assert_allclose(dovetail.from_sep005(kilonewton).frf.values, expected.frf.values, rtol=1e-9)


def test_signals_pass_the_checks_of_sep_5(hits):
    """Those of sdypy-sep005 1.0: names, units, the time, and no word that is prohibited."""
    for signal in dovetail.to_sep005(*hits, 2048.0):
        assert {"data", "name", "unit_str", "fs"} <= set(signal)
        assert signal["data"].ndim == 1
        assert signal["quantity"] in "favdes"
        assert signal["unit_str"] in ("N", "m/s²")
        assert not {name.lower() for name in signal} & {"timestamp"}
    sep005 = pytest.importorskip("sdypy_sep005")
    for signal in dovetail.to_sep005(*hits, 2048.0):
        sep005.Sep005Data.model_validate(signal)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"unit_str": "kg"}, "the unit 'kg' of 'force 1' is not that of a force or a motion"),
        ({"fs": 100.0}, "sampled at 100, 2048 Hz"),
        ({"unit_str": "m/s", "quantity": "v"}, "1 of force, 1 of mobility, 2 of accelerance"),
        ({"fs": None}, "has no 'fs', and no even 'time'"),
        ({"quantity": "a"}, "has the unit 'N' and the quantity 'a'"),
        ({"time": np.arange(1024) / 1024}, "sampled at 1024, 2048 Hz"),
    ],
)
def test_signals_that_do_not_fit_are_refused(hits, change, problem):
    first, *others = dovetail.to_sep005(*hits, 2048.0)
    with pytest.raises(dovetail.MeasurementError, match=problem):
        dovetail.from_sep005([{**first, **change}, *others])


def test_frfs_come_back_from_the_tables_of_pyfbs():
    pytest.importorskip("pandas")
    names = ("1+x", "2-y", "spindle+z")
    frfs = [frf(response=o, force=i, quantity="accelerance", label=f"{o} by {i}") for o in names for i in names[:2]]
    frfs = [dovetail.Frf(FREQUENCY, f.values * n, "accelerance", response=f.response, force=f.force, label=f.label)
            for n, f in enumerate(frfs, 1)]  # fmt: skip
    tables = dovetail.to_pyfbs(frfs, {"2": (0.1, 0.2, 0.3)})
    assert tables.Y.shape == (20, 3, 2)
    assert list(tables.df_chn["Quantity"]) == ["Acceleration"] * 3
    assert list(tables.df_imp["Direction_2"]) == [0.0, -1.0]
    assert list(tables.df_imp.loc[1, ["Position_1", "Position_2", "Position_3"]]) == [0.1, 0.2, 0.3]
    for original, again in zip(frfs, dovetail.from_pyfbs(*tables), strict=True):
        assert_equal(original, again)


@pytest.mark.parametrize("table", ["df_chn", "df_imp"])
@pytest.mark.parametrize("column", ["Unit", "Sensitivity", "Polarity", "Delay", "dB", "Axis"])
def test_a_column_that_may_act_on_the_values_is_refused(table, column):
    pytest.importorskip("pandas")
    tables = dovetail.to_pyfbs([frf(response="1+x", force="1+x")])
    changed = tables._replace(**{table: getattr(tables, table).assign(**{column: "g"})})
    with pytest.raises(dovetail.MeasurementError, match=f"the column '{column}' may change"):
        dovetail.from_pyfbs(*changed)
    without = tables._replace(**{table: getattr(tables, table).assign(**{column: None, "Unnamed: 0": 3})})
    dovetail.from_pyfbs(*without)


@pytest.mark.parametrize(("name", "way"), [("1+x", (-1, 0, 0)), ("1-x", (1, 0, 0)), ("1+y", (1, 0, 0))])
def test_a_name_that_contradicts_its_direction_is_refused(name, way):
    pytest.importorskip("pandas")
    tables = dovetail.to_pyfbs([frf(response=name, force="1+x")])
    turned = tables.df_chn.assign(**{f"Direction_{number}": part for number, part in enumerate(way, 1)})
    with pytest.raises(dovetail.MeasurementError, match="the direction of"):
        dovetail.from_pyfbs(tables.Y, tables.freq, turned, tables.df_imp)


OTHER_UNITS = [
    *((name, "frf", "units", unit) for name in FRFS for unit in ("g/N", "um/N")),
    *((name, "frf", "long_name", "impedance") for name in FRFS),
    *((name, "frequency", "units", "kHz") for name in FRFS),
    ("measured", "coherence", "units", "%"),
    ("known variance", "variance", "units", "(g/N)^2"),
]


@pytest.mark.parametrize(("name", "array", "attribute", "value"), OTHER_UNITS)
def test_arrays_in_other_units_are_refused(name, array, attribute, value):
    pytest.importorskip("xarray")
    arrays = dovetail.to_xarray(frf(**FRFS[name]))
    arrays[array].attrs[attribute] = value
    with pytest.raises(dovetail.MeasurementError, match=f"'{attribute}' is"):
        dovetail.from_xarray(arrays)


def test_tables_that_do_not_fit_are_refused():
    pytest.importorskip("pandas")
    with pytest.raises(dovetail.MeasurementError, match=r"the FRFs of 2 by 2 are missing"):
        dovetail.to_pyfbs([frf(response=o, force=i) for o, i in (("1", "1"), ("1", "2"), ("2", "1"))])
    with pytest.raises(dovetail.MeasurementError, match="not on the same frequencies"):
        dovetail.to_pyfbs([frf(response="1", force="1"),
                           dovetail.Frf([1.0], [1.0], "mobility", response="2", force="1")])  # fmt: skip
    with pytest.raises(dovetail.MeasurementError, match="no names"):
        dovetail.to_pyfbs([frf()])
    tables = dovetail.to_pyfbs([frf(response="1", force="1")])
    with pytest.raises(dovetail.MeasurementError, match="its shape is"):
        dovetail.from_pyfbs(tables.Y[:5], *tables[1:])
    with pytest.raises(dovetail.MeasurementError, match="Strain"):
        dovetail.from_pyfbs(tables.Y, tables.freq, tables.df_chn.assign(Quantity="Strain"), tables.df_imp)


@pytest.mark.parametrize("name", [name for name in FRFS if name != "known variance"])
@pytest.mark.parametrize("quantity", ["receptance", "mobility", "accelerance"])
def test_an_frf_comes_back_from_a_universal_file(name, quantity, tmp_path):
    original = frf(**{**FRFS[name], "quantity": quantity})
    dovetail.write_frf(original, tmp_path / "frf.uff")
    again = dovetail.read_frf(tmp_path / "frf.uff")
    np.testing.assert_allclose(again.values, original.values, rtol=1e-11)  # it writes 13 digits
    np.testing.assert_allclose(again.frequency, original.frequency, rtol=1e-12)
    assert (again.quantity, again.unit) == (original.quantity, original.unit)


@pytest.mark.parametrize("package", ["xarray", "pandas"])
def test_a_package_that_is_missing_is_named_with_its_extra(package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    convert = {"xarray": lambda: dovetail.to_xarray(frf()), "pandas": lambda: dovetail.to_pyfbs([frf()])}[package]
    with pytest.raises(dovetail.DovetailError, match=rf'pip install "dovetail-frf\[{package}\]"'):
        convert()
