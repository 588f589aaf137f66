"""Faults of response and identification, each with its exact message."""

from __future__ import annotations

import pytest

CASES = {
    "response_key_missing": (
        {"position: 10 mm": "direction: x"},
        "test.yaml:23:1  response.position\n  'response' lacks 'position'.\n  Accepted: a quantity in m",
    ),
    "response_nowhere": (
        {"response: {at: tool": "response: {at: tol"},
        "test.yaml:23:16  response.at\n"
        "  there is no substructure 'tol'.\n"
        "  Did you mean 'tool'?  Accepted: tool, holder",
    ),
    "response_between_nodes": (
        {"position: 10 mm": "position: 12 mm"},
        "test.yaml:23:32  response.position\n"
        "  substructure 'tool' has no node at 12 mm.\n"
        "  The nearest nodes are at 10 mm and 20 mm.  Accepted: 0 mm, 10 mm, 20 mm, 30 mm, 40 mm, 50 "
        "mm, 60 mm, 70 mm, 80 mm, 90 mm, 100 mm",
    ),
    "response_direction": (
        {"position: 10 mm": "position: 10 mm, direction: y"},
        "test.yaml:23:50  response.direction\n  'tool' does not move in the direction y there.\n  Accepted: x, rz",
    ),
    "response_quantity": (
        {"position: 10 mm": "position: 10 mm, quantity: acelerance"},
        "test.yaml:23:49  response.quantity\n"
        "  'acelerance' is not one of the choices.\n"
        "  Did you mean 'accelerance'?  Accepted: receptance, mobility, accelerance",
    ),
    "too_few_samples": (
        {"samples: 100": "samples: 5"},
        "test.yaml:25:12  identification.samples\n  5 must be at least 10.",
    ),
    "samples_is_a_truth_value": (
        {"samples: 100": "samples: yes\n  seed: true"},
        "test.yaml:25:12  identification.samples\n"
        "  'yes' is not a whole number.\n"
        "test.yaml:26:9  identification.seed\n"
        "  true is not a number.",
    ),
    "seed_negative": ({"samples: 100": "seed: -1"}, "test.yaml:25:9  identification.seed\n  -1 must be at least 0."),
    "test_fraction": (
        {"samples: 100": "test_fraction: 1.5"},
        "test.yaml:25:18  identification.test_fraction\n  1.5 must be less than 1.",
    ),
    "test_part_too_small": (
        {"samples: 100": "samples: 100\n  test_fraction: 0.01"},
        "test.yaml:26:18  identification.test_fraction\n"
        "  1 of 100 samples would be for testing, 99 for training.\n"
        "  Each needs 2 at least.",
    ),
    "features_unknown": (
        {"samples: 100": "features: log10"},
        "test.yaml:25:13  identification.features\n"
        "  'log10' is not one of the choices.\n"
        "  Did you mean 'log10p1'?  Accepted: log10p1",
    ),
    "reducer_unknown": (
        {"model: squeeze": "model: squeze"},
        "test.yaml:26:20  identification.reducer.model\n"
        "  'squeze' is not a reducer model.\n"
        "  Did you mean 'squeeze'? A model of your own needs `plugins='FILE.py'` or, in a package, "
        "`pip install -e FOLDER` once more.  "
        "Accepted: squeeze, umap",
    ),
    "reducer_option": (
        {"n_components: 5": "n_neighbours: 5"},
        "test.yaml:26:29  identification.reducer.n_neighbours\n"
        "  'n_neighbours' is not a key of reducer model 'squeeze' (fake 1.0).\n"
        "  Did you mean 'n_components'?  Accepted: model, n_components, metric",
    ),
    "reducer_choice": (
        {"n_components: 5": "metric: euclidian"},
        "test.yaml:26:37  identification.reducer.metric\n"
        "  'euclidian' is not one of the choices.\n"
        "  Did you mean 'euclidean'?  Accepted: correlation, euclidean",
    ),
    "reducer_is_a_name": (
        {"reducer: {model: squeeze, n_components: 5}": "reducer: squeeze"},
        "test.yaml:26:12  identification.reducer\n"
        "  'squeeze' is not a section of keys and values.\n"
        "  Accepted: a section that begins with 'model:'",
    ),
    "response_on_the_wall": (
        {
            "joints:\n": (
                "  base: {model: wall}\n"
                "joints:\n"
                "  floor: {model: weld, connect: {a: {to: base, at: 0}, b: {to: tool, at: 0}}}\n"
            ),
            "response: {at: tool, position: 10 mm}": "response: {at: base, position: 0}",
        },
        "test.yaml:25:16  response.at\n"
        "  the response cannot be at 'base', which does not move.\n"
        "  Accepted: tool, holder",
    ),
    "identification_key": (
        {"samples: 100": "sample: 100"},
        "test.yaml:25:3  identification.sample\n"
        "  'sample' is not a key of 'identification'.\n"
        "  Did you mean 'samples'?  Accepted: samples, seed, test_fraction, features, reducer, regressor, "
        "augmentation, correction, method",
    ),
    "samples_is_a_text": (
        {"samples: 100": "samples: many"},
        "test.yaml:25:12  identification.samples\n  'many' is not a whole number.",
    ),
    "seed_too_large": (
        {"samples: 100": "seed: 5000000000"},
        "test.yaml:25:9  identification.seed\n  5000000000 must be at most 4294967295.",
    ),
    "remaining_mass_without_a_drive_point": (
        {"position: 10 mm": "position: 10 mm, force: {position: 50 mm}", "samples: 100": "augmentation: {mass: 2 g}"},
        "test.yaml:25:24  identification.augmentation.mass\n"
        "  the mass is at the drive point, and a response is a rotation or has its force elsewhere.\n"
        "  Leave it out.",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_each_fault_has_its_message(case, message, broken):
    edits, expected = CASES[case]
    assert message(broken(edits)) == expected
