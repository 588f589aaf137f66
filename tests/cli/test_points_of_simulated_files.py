"""The points in files of an assembly's own FRFs, compared with the responses for which these are used."""

import numpy as np
import pytest
import yaml

import dovetail
from dovetail.identification.measured_lines import check_measured

SECTION = {"length": "100 mm", "outer": "20 mm", "elements": 4}
STEEL = {"young": "210 GPa", "density": "7850 kg/m^3", "poisson": 0.3, "loss_factor": 0.003}
TIP = {"at": "tool", "position": "0 mm", "quantity": "receptance"}
FORCE_AT_END = {"position": "100 mm"}


def _described(response, model="timoshenko_beam", name="tool"):
    return {
        "dovetail": 1,
        "name": "bars",
        "frequency": {"start": "100 Hz", "stop": "900 Hz", "step": "100 Hz"},
        "substructures": {
            name: {"model": model, "material": STEEL, "sections": [SECTION]},
            "holder": {"model": model, "material": STEEL, "sections": [SECTION]},
        },
        "joints": {
            "screw": {
                "model": "rigid",
                "connect": {"a": {"to": name, "at": "100 mm"}, "b": {"to": "holder", "at": "0 mm"}},
            }
        },
        "response": response,
    }


def _simulated(run, tmp_path, described, suffix):
    description, file = tmp_path / "assembly.yaml", tmp_path / f"simulated{suffix}"
    description.write_text(yaml.safe_dump(described), encoding="utf-8")
    run("simulate", description, "-o", file)
    return dovetail.read_frf(file)


@pytest.mark.parametrize("suffix", [".csv", ".uff", ".npz"])
@pytest.mark.parametrize(
    ("own", "other"),
    [
        (TIP, TIP | {"position": "50 mm"}),
        (TIP, TIP | {"at": "holder"}),
        (TIP | {"force": FORCE_AT_END}, TIP),
        (TIP, TIP | {"force": FORCE_AT_END}),
        (TIP | {"force": FORCE_AT_END}, TIP | {"position": "100 mm", "force": {"position": "0 mm"}}),
        (TIP, TIP | {"direction": "rz"}),
    ],
)
def test_a_simulated_file_is_that_of_its_response_only(run, tmp_path, suffix, own, other):
    frf = _simulated(run, tmp_path, _described(own), suffix)
    assembly = dovetail.load(_described(own))
    assert np.allclose(frf.values, assembly.simulate().values, rtol=1e-11, atol=0.0)
    assert check_measured(assembly.description, frf) == (frf,)
    with pytest.raises(dovetail.MeasurementError, match=r"used (at|as)|where it is used|the response is"):
        check_measured(dovetail.load(_described(other)).description, frf)


@pytest.mark.parametrize("suffix", [".csv", ".uff", ".npz"])
@pytest.mark.parametrize("direction", ["x", "z", "-x", [0.6, 0.0, 0.8]])
def test_directions_in_space_are_written_as_far_as_they_have_a_name(run, tmp_path, suffix, direction):
    own = TIP | {"direction": direction}
    frf = _simulated(run, tmp_path, _described(own, "spatial_beam"), suffix)
    assembly = dovetail.load(_described(own, "spatial_beam"))
    assert np.allclose(frf.values, assembly.simulate().values, rtol=1e-11, atol=0.0)
    assert check_measured(assembly.description, frf) == (frf,)
    ending = "" if isinstance(direction, list) else f", {direction}".replace("-", "minus ")
    assert frf.response == frf.force == f"tool, 0 mm{ending}"
    if ending:
        other = dovetail.load(_described(TIP | {"direction": "y"}, "spatial_beam"))
        with pytest.raises(dovetail.MeasurementError, match="it is used along y"):
            check_measured(other.description, frf)


def test_points_that_cannot_be_read_back_are_left_out(run, tmp_path):
    """The name of this part is also that of an axis."""
    described = _described(TIP | {"at": "y"}, name="y")
    frf = _simulated(run, tmp_path, described, ".csv")
    assert check_measured(dovetail.load(described).description, frf) == (frf,)


def test_a_universal_file_has_directions_in_its_header(run, tmp_path):
    pyuff = pytest.importorskip("pyuff")
    _simulated(run, tmp_path, _described(TIP | {"direction": "rz"}), ".uff")
    fields = pyuff.UFF(str(tmp_path / "simulated.uff")).read_sets(0)
    assert (fields["rsp_dir"], fields["ref_dir"]) == (6, 6)
