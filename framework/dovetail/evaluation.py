"""What evaluations of methods, networks and models are made of: parallel cases, checks of measurements, peaks."""

from __future__ import annotations

from dovetail.assembly import AssemblySource, as_assembly, modes_in_band
from dovetail.atomic_files import locked
from dovetail.coupling.receptance import Receptance, decouple
from dovetail.dataset import Storage
from dovetail.description import SearchRange, read_description
from dovetail.description.study_section import SearchSection
from dovetail.documents.fault_list import FaultList
from dovetail.errors import as_dovetail_error, listing, require_package
from dovetail.frf import coherence_with_model
from dovetail.frf.resonance_peaks import counterpart, resonance_peaks
from dovetail.identification.measured_lines import batch_contradictions, check_measured
from dovetail.identification.one_measurement import check_mass, find_method
from dovetail.identification.prediction import joint_values, predicted_frf
from dovetail.identification.result import joined_warnings
from dovetail.inference.posterior import LEVEL, NOT_TRUSTWORTHY, PRIOR_PRECISION
from dovetail.interfaces import progress_reporter
from dovetail.measurement import check_cover, data_noise, on_grid, within_band
from dovetail.measurement.file_section import MeasuredFile
from dovetail.measurement.noise import NOISE_KINDS, NoiseKind
from dovetail.network.bundle import TrainedNetwork
from dovetail.network.evaluation import parameter_metrics
from dovetail.network.preprocessing import draw_test_samples
from dovetail.network.training import needs_phase, train_and_evaluate
from dovetail.parallel import cores, on_cluster, require_cluster, side_by_side
from dovetail.registry import PluginPaths, Registry, components
from dovetail.series.description import Covariate
from dovetail.series.measured_files import read_test
from dovetail.series.series_file import SeriesFile, TestSection
from dovetail.synthesis import Attachment, Connection

__all__ = [
    "LEVEL",
    "NOISE_KINDS",
    "NOT_TRUSTWORTHY",
    "PRIOR_PRECISION",
    "AssemblySource",
    "Attachment",
    "Connection",
    "Covariate",
    "FaultList",
    "MeasuredFile",
    "NoiseKind",
    "PluginPaths",
    "Receptance",
    "Registry",
    "SearchRange",
    "SearchSection",
    "SeriesFile",
    "Storage",
    "TestSection",
    "TrainedNetwork",
    "as_assembly",
    "as_dovetail_error",
    "batch_contradictions",
    "check_cover",
    "check_mass",
    "check_measured",
    "coherence_with_model",
    "components",
    "cores",
    "counterpart",
    "data_noise",
    "decouple",
    "draw_test_samples",
    "find_method",
    "joined_warnings",
    "joint_values",
    "listing",
    "locked",
    "modes_in_band",
    "needs_phase",
    "on_cluster",
    "on_grid",
    "parameter_metrics",
    "predicted_frf",
    "progress_reporter",
    "read_description",
    "read_test",
    "require_cluster",
    "require_package",
    "resonance_peaks",
    "side_by_side",
    "train_and_evaluate",
    "within_band",
]
