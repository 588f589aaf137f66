"""Notes in text files that look like Dovetail's own, but lack what it always writes."""

import pytest

import dovetail

ROWS = "frequency_Hz,real,imag\n10,1e-6,-1e-8\n20,2e-6,-2e-8\n30,3e-6,-3e-8\n"


@pytest.mark.parametrize("note", ["complex conjugate", "phase inverted", "exp(-iwt)"])
def test_a_note_on_changed_values_is_refused_without_a_unit(tmp_path, note):
    """Dovetail writes a unit, and its notes are remarks; those of others say what was done with the values."""
    file = tmp_path / "measured.csv"
    file.write_text(f"# quantity: receptance\n# note: {note}\n{ROWS}", encoding="utf-8")
    with pytest.raises(dovetail.MeasurementError, match="may act on the values"):
        dovetail.read_frf(file)
    file.write_text(f"# quantity: receptance\n# unit: m/N\n# note: {note}\n{ROWS}", encoding="utf-8")
    assert dovetail.read_frf(file).note == note
