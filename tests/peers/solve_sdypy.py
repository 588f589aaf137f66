"""sdypy-EMA and Dovetail's function model on the modal parameters of one FRF: ``python tests/peers/solve_sdypy.py``."""

import time

import numpy as np
from problems import POLES, Scores, modal_frf

import dovetail

frequency, values = modal_frf()
true_frequency, true_damping = np.transpose(POLES)


def show(program, frequencies, dampings, seconds):
    scores = Scores("modal parameters")
    scores.show(
        program=program,
        frequency_error_percent=round(100 * float(np.max(np.abs(frequencies / true_frequency - 1))), 4),
        damping_error_percent=round(100 * float(np.max(np.abs(dampings / true_damping - 1))), 2),
        cpu_seconds=round(seconds, 2),
    )


try:
    from sdypy import EMA
except ImportError:
    EMA = None
if EMA is not None:
    began = time.process_time()
    # begin
    frf = dovetail.Frf(frequency, values, "receptance")
    model = EMA.Model(**dovetail.to_sdypy(frf), lower=50, upper=890, pol_order_high=40)
    model.get_poles(method="lscf", show_progress=False)
    model.select_closest_poles(list(true_frequency), f_window=10)
    found = np.array(model.nat_freq), np.array(model.nat_xi)
    # end
    show("sdypy-EMA", *found, time.process_time() - began)


def four_modes(frequency, **numbers):
    s, total = 2j * np.pi * frequency, 0.0
    for n in range(4):
        omega = 2 * np.pi * numbers[f"f{n}"]
        total = total + numbers[f"r{n}"] / (s**2 + 2 * numbers[f"z{n}"] * omega * s + omega**2)
    return total


began = time.process_time()
ranges = [dovetail.Parameter(f"f{n}", "Hz", 0.97 * f, 1.03 * f) for n, f in enumerate(true_frequency)]
ranges += [dovetail.Parameter(f"z{n}", "1", 1e-3, 0.1, "log") for n in range(4)]
ranges += [dovetail.Parameter(f"r{n}", "1/kg", 0.2, 5.0, "log") for n in range(4)]
ours = dovetail.CallableModel(four_modes, ranges, frequency)
result = dovetail.identify(ours, dovetail.Frf(frequency, values, "receptance"), "refined")
show("Dovetail", result.theta[:4], result.theta[4:8], time.process_time() - began)
