"""A trained model that identifies, and can be saved and loaded."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

from dovetail.assembly import Assembly, AssemblySource, as_assembly
from dovetail.dataset import Dataset
from dovetail.description import SHARED
from dovetail.errors import Fault, ParameterError, listing
from dovetail.identification.one_measurement import Measurement, identify
from dovetail.identification.result import Identification
from dovetail.interfaces import IdentificationMethod, Progress, logged, progress_reporter
from dovetail.network.bundle import TrainedNetwork, read_bundle, write_bundle
from dovetail.network.learners import Learner, with_learners
from dovetail.network.training import train_network
from dovetail.plain_text import html_table, terminal_text
from dovetail.registry import PluginPaths
from dovetail.units import format_quantity


class Identifier(TrainedNetwork):
    """A trained network that identifies joints of the assembly it was trained for.

    `train` and `load_model` give one. Its fields are those of `TrainedNetwork`.
    """

    def __repr__(self) -> str:
        tested = f"{self.evaluation.training_samples} training samples, mean R2 {self.evaluation.mean_r2:.3f}"
        return f"<Identifier: {terminal_text(self.assembly.name)}, {tested}>"

    def _repr_html_(self) -> str:
        rows = [
            (name, "" if metrics.r2 is None else f"{metrics.r2:.3f}", format_quantity(metrics.rmse_si, metrics.unit, 3))
            for name, metrics in self.evaluation.parameters.items()
        ]
        return html_table(repr(self), [("parameter", "R2", "RMS error"), *rows])

    @classmethod
    def of(cls, trained: TrainedNetwork) -> Self:
        """Return the identifier of a trained network."""
        return cls(trained.assembly, trained.network, trained.evaluation, trained.novelty)

    def identify(
        self, measured: Measurement, method: str | IdentificationMethod | None = None, **options: Any
    ) -> Identification:
        """Identify the joint from the measured FRF of the assembly's response point, or of each of its points.

        Parameters
        ----------
        measured : Frf or path, or sequence of them
            One for each response, of any quantity. For the network it must cover the assembly's frequencies, to which
            it is interpolated; the other methods compare its own lines, as `dovetail.identify` says.
        method : str or IdentificationMethod, optional
            As in `dovetail.identify`: ``"posterior"``, with intervals, where the trained network's answer is one of the
            starts and is part of the result; or ``"network"``, its answer as it is, in milliseconds; and so on.
        **options
            Of the method, see `dovetail.identify`.

        Returns
        -------
        Identification

        Raises
        ------
        MeasurementError
            The measurement has no lines within the assembly's frequencies; for the network: does not cover them, or
            lies so far from the training data that the network has no finite answer.
        ParameterError
            The method has no such option.
        ValueError
            `method` is not a method.
        """
        return identify(self.assembly, measured, method, model=self, **options)

    def save(self, path: str | Path) -> Path:
        """Write the model as a bundle: a folder of JSON and safetensors, nothing pickled.

        Parameters
        ----------
        path : str or Path
            The folder; a model that is there already is replaced at once and never absent.

        Returns
        -------
        Path

        Raises
        ------
        BundleError
            Something else than a model is at `path`, or it cannot be written.
        """
        return write_bundle(self, path)


def train(
    assembly: AssemblySource,
    dataset: Dataset | str | Path | None = None,
    *,
    reducer: Learner = None,
    regressor: Learner = None,
    robust: bool = False,
    fresh: bool = False,
    minutes: float | None = None,
    progress: Progress | bool | None = None,
) -> Identifier:
    """Train the network of an assembly's description and evaluate it on the test part of the dataset.

    Parameters
    ----------
    assembly : Assembly or path
        Or its description.
    dataset : Dataset or path, optional
        Samples of this assembly. Without one, as many as the description says are generated and then discarded.
    reducer, regressor : str, Reducer or Regressor, scikit-learn estimator, or mapping, optional
        Others than the description's: a name (``"pca"``), an object of a shipped class or your own, an estimator of
        scikit-learn before it is fitted (``KernelRidge(alpha=0.1)``), or a section as in a description.
    robust : bool
        Train on FRFs with noise, as the description's `augmentation` says or else by its defaults. A description that
        has an `augmentation` is trained so in any case.
    fresh : bool
        Robust training in which every epoch draws new parameters and new noise, as many as the dataset has: no sample
        is seen twice. The dataset gives the first ones, the reducer's, and the test.
    minutes : float, optional
        Time for the regressor, which then ends with the best that it has; the same machine and load aside, results are
        reproducible only without it.
    progress : bool or callable, optional
        True shows bars in a terminal or a notebook; a function is called as `Progress` says.

    Returns
    -------
    Identifier

    Raises
    ------
    DatasetError
        The dataset is not of this assembly, too small to be split, or holds values that are not finite.
    ParameterError
        `reducer` or `regressor` is not one, or has wrong options; `minutes` is not a positive time, or the regressor
        ignores it; or the assembly is one response of several (`Assembly.at`) and has parameters of another one's
        measurement chain, which its FRF does not depend on.
    PluginError
        The reducer or the regressor breaks its contract.
    """
    samples = Dataset(dataset) if isinstance(dataset, (str, Path)) else dataset
    known = with_learners(as_assembly(assembly), reducer, regressor)
    _check_chains(known)
    with progress_reporter(progress) as report:
        trained = train_network(known, samples, robust=robust, fresh=fresh, minutes=minutes, progress=report)
    return Identifier.of(trained)


def _check_chains(assembly: Assembly) -> None:
    """Refuse what remains of other responses' chains: a saved model is read by its description, without those."""
    description = assembly.description
    own_chains = {SHARED, *(response.name for response in description.responses)}
    owners = {owner for owner, _ in description.identified_parameters}
    owners |= {tie.owner for entry in description.entries.values() for tie in entry.ties.values()}
    if strange := sorted((owners & set(description.calibrations)) - own_chains):
        problem = f"it has parameters of the chain of {listing(strange)}, whose FRF is not among its own."
        remedy = "Train on all responses, or describe this one alone."
        raise ParameterError(Fault(f"assembly {assembly.name}", problem, remedy=remedy))


def load_model(path: str | Path, *, plugins: PluginPaths = ()) -> Identifier:
    """Load a model that `Identifier.save` wrote.

    Parameters
    ----------
    path : str or Path
        The folder.
    plugins : path or iterable of paths
        Plugin files that the model's components come from. A bundle itself never runs code.

    Returns
    -------
    Identifier

    Raises
    ------
    BundleError
        The bundle is damaged, tampered with, of another program or of a newer format; a component is missing; or the
        components here answer otherwise, or give other FRFs, than when the model was trained.
    PluginError
        A plugin file cannot be loaded.
    """
    with logged(__name__, f"model {path} read"):
        return Identifier.of(read_bundle(path, plugins=plugins))
