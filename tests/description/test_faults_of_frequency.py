"""Faults of frequency, each with its exact message."""

from __future__ import annotations

import pytest

CASES = {
    "frequency_unknown_key": (
        {"step: 2 Hz": "stepp: 2 Hz"},
        "test.yaml:3:42  frequency.stepp\n"
        "  'stepp' is not a key of 'frequency'.\n"
        "  Did you mean 'step'?  Accepted: start [Hz], stop [Hz], step [Hz], lines, bands [Hz], without [Hz]",
    ),
    "frequency_without_step": (
        {", step: 2 Hz": ""},
        "test.yaml:3:1  frequency\n  the frequency has no step.\n  Accepted: step or lines",
    ),
    "frequency_step_and_lines": (
        {"step: 2 Hz": "step: 2 Hz, lines: 51"},
        "test.yaml:3:1  frequency\n  the frequency has a step and a number of lines.\n  Accepted: step or lines",
    ),
    "frequency_in_metres": (
        {"start: 100 Hz": "start: 100 mm"},
        "test.yaml:3:20  frequency.start\n  '100 mm' is not in Hz, or in a unit that can be converted to it.",
    ),
    "frequency_from_zero": (
        {"start: 100 Hz": "start: 0"},
        "test.yaml:3:20  frequency.start\n  0 must be greater than 0.",
    ),
    "frequency_backwards": (
        {"stop: 200 Hz": "stop: 50 Hz"},
        "test.yaml:3:34  frequency.stop\n  stop (50 Hz) must be greater than start (100 Hz).",
    ),
    "frequency_stop_off_the_grid": (
        {"stop: 200 Hz": "stop: 201 Hz"},
        "test.yaml:3:34  frequency.stop\n"
        "  stop (201 Hz) is not on a line: from 100 Hz in steps of 2 Hz.\n"
        "  The lines nearest to it are 200 Hz and 202 Hz.",
    ),
    "frequency_step_longer_than_all": (
        {"step: 2 Hz": "step: 1 GHz"},
        "test.yaml:3:34  frequency.stop\n"
        "  stop (200 Hz) is not on a line: from 100 Hz in steps of 1000000000 Hz.\n"
        "  The lines nearest to it are 100 Hz and 1000000100 Hz.",
    ),
    "frequency_too_many_lines": (
        {"step: 2 Hz": "step: 1 uHz"},
        "test.yaml:3:48  frequency.step\n  1e+08 lines are more than 1000000.",
    ),
    "frequency_too_few_lines": ({"step: 2 Hz": "lines: 1"}, "test.yaml:3:49  frequency.lines\n  1 must be at least 2."),
    "frequency_lines_not_whole": (
        {"step: 2 Hz": "lines: 10.5"},
        "test.yaml:3:49  frequency.lines\n  10.5 is not a whole number.",
    ),
    "frequencies_fall": (
        {"{start: 100 Hz, stop: 200 Hz, step: 2 Hz}": "[100 Hz, 200 Hz, 150 Hz]"},
        "test.yaml:3:29  frequency[2]\n  150 Hz does not lie above 200 Hz.\n  Accepted: increasing frequencies",
    ),
    "one_frequency": (
        {"{start: 100 Hz, stop: 200 Hz, step: 2 Hz}": "[100 Hz]"},
        "test.yaml:3:1  frequency\n  a list must have 2 or more elements.",
    ),
    "frequency_is_a_text": (
        {"{start: 100 Hz, stop: 200 Hz, step: 2 Hz}": "audible"},
        "test.yaml:3:12  frequency\n  'audible' is not a section of keys and values.",
    ),
    "band_is_empty": (
        {"step: 2 Hz}": "step: 2 Hz, bands: [[150 Hz, 120 Hz]]}"},
        "test.yaml:3:62  frequency.bands[0]\n  the band from 150 to 120 Hz is empty.",
    ),
    "nothing_is_left": (
        {"step: 2 Hz}": "step: 2 Hz, without: [[90 Hz, 210 Hz]]}"},
        "test.yaml:3:54  frequency.without\n  0 of 51 lines are left to compare.",
    ),
    "frequency_key_missing": (
        {"start: 100 Hz, ": ""},
        "test.yaml:3:1  frequency.start\n  'frequency' lacks 'start'.\n  Accepted: a quantity in Hz",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_each_fault_has_its_message(case, message, broken):
    edits, expected = CASES[case]
    assert message(broken(edits)) == expected
