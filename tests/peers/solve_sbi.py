"""sbi's NPE with the same simulator, on logarithms of amplitudes: ``python tests/peers/solve_sbi.py``."""

import numpy as np
import torch
from problems import CASES, COLLETS, NOISE, Scores, collet, measurement, one_mass
from sbi.inference import NPE
from sbi.utils import BoxUniform

import dovetail

torch.set_num_threads(1)
for problem, assembly, cases, count in (("one mass", one_mass(), CASES, 2000), ("collet", collet(40), COLLETS, 4000)):
    scores = Scores(problem)
    width = len(assembly.parameters)
    # begin
    torch.manual_seed(0)
    random = np.random.default_rng(0)
    prior = BoxUniform(torch.zeros(width), torch.ones(width))
    theta = prior.sample((count,))
    clean = assembly.frf(assembly.from_unit(theta.numpy().astype(float)))
    quantity = assembly.description.response.quantity
    noisy = [dovetail.noisy_frf(dovetail.Frf(assembly.frequency, row, quantity), NOISE, random) for row in clean]
    x = torch.tensor(np.log10([frf.amplitude for frf in noisy]), dtype=torch.float32)
    inference = NPE(prior=prior)
    inference.append_simulations(theta, x).train(max_num_epochs=100, show_train_summary=False)
    posterior = inference.build_posterior()
    # end
    for seed in range(cases):
        truth, measured = measurement(assembly, seed)
        observed = torch.tensor(np.log10(measured.amplitude), dtype=torch.float32)
        samples = posterior.sample((1000,), x=observed, show_progress_bars=False).numpy()
        scores.add(assembly, truth, samples.mean(axis=0), np.quantile(samples, [0.05, 0.95], axis=0))
    scores.show(simulations=count)
