"""The contracts that plugins implement, each in a separate file."""

from dovetail.interfaces.component import (
    INTERFACE_VERSION,
    KINDS,
    OLDEST_INTERFACE,
    Component,
    ComponentConfig,
    Kind,
    plugin_errors,
    source_file,
)
from dovetail.interfaces.context import FeatureContext, fit_in_context, takes_context
from dovetail.interfaces.coordinates import (
    Coordinates,
    are_perpendicular,
    exact_rotation,
    rigid_body_motions,
    six_directions,
)
from dovetail.interfaces.declarations import joint_faults, node_faults, parameter_faults, port_faults
from dovetail.interfaces.file_name import FileName
from dovetail.interfaces.fit_options import FIT_OPTIONS, FitOptions, PosteriorOptions
from dovetail.interfaces.joint import JointModel, Parameter, Prior, Scale
from dovetail.interfaces.law import Law, LawUnknown
from dovetail.interfaces.matrices import (
    DIRECTIONS,
    PLANAR,
    ROTATIONS,
    Direction,
    NodeDofs,
    ScaledMatrices,
    SparseMatrices,
    StructuralMatrices,
    carried,
    cross_matrix,
    describes_matrices,
    is_rotation,
)
from dovetail.interfaces.method import Estimate, IdentificationMethod, IdentificationProblem
from dovetail.interfaces.option_schemas import option_schema
from dovetail.interfaces.progress import NO_LIMIT, CutShort, Progress, TimeLimit, logged, progress_reporter, silent
from dovetail.interfaces.reader import FileReader, FrfReader, MatrixReader
from dovetail.interfaces.recorded import (
    About,
    ArrayEntry,
    FrfToWrite,
    Recorded,
    RecordedArrays,
    RecordedChannels,
    RecordedFrf,
    RecordedSet,
    RecordedSignal,
    Statement,
)
from dovetail.interfaces.recorded_model import DofTable, MatrixMeaning, RecordedMatrix, RecordedModel
from dovetail.interfaces.reducer import FittedReducer, Reducer
from dovetail.interfaces.regressor import FittedRegressor, Regressor, TargetDistribution, TrainingEpoch, spread_normal
from dovetail.interfaces.state import ComponentState
from dovetail.interfaces.substructure import JointPort, Omission, PartNode, SectionOutline, SubstructureModel
from dovetail.interfaces.superposition import Declaration, Superposition

__all__ = [
    "DIRECTIONS",
    "FIT_OPTIONS",
    "INTERFACE_VERSION",
    "KINDS",
    "NO_LIMIT",
    "OLDEST_INTERFACE",
    "PLANAR",
    "ROTATIONS",
    "About",
    "ArrayEntry",
    "Component",
    "ComponentConfig",
    "ComponentState",
    "Coordinates",
    "CutShort",
    "Declaration",
    "Direction",
    "DofTable",
    "Estimate",
    "FeatureContext",
    "FileName",
    "FileReader",
    "FitOptions",
    "FittedReducer",
    "FittedRegressor",
    "FrfReader",
    "FrfToWrite",
    "IdentificationMethod",
    "IdentificationProblem",
    "JointModel",
    "JointPort",
    "Kind",
    "Law",
    "LawUnknown",
    "MatrixMeaning",
    "MatrixReader",
    "NodeDofs",
    "Omission",
    "Parameter",
    "PartNode",
    "PosteriorOptions",
    "Prior",
    "Progress",
    "Recorded",
    "RecordedArrays",
    "RecordedChannels",
    "RecordedFrf",
    "RecordedMatrix",
    "RecordedModel",
    "RecordedSet",
    "RecordedSignal",
    "Reducer",
    "Regressor",
    "Scale",
    "ScaledMatrices",
    "SectionOutline",
    "SparseMatrices",
    "Statement",
    "StructuralMatrices",
    "SubstructureModel",
    "Superposition",
    "TargetDistribution",
    "TimeLimit",
    "TrainingEpoch",
    "are_perpendicular",
    "carried",
    "cross_matrix",
    "describes_matrices",
    "exact_rotation",
    "fit_in_context",
    "is_rotation",
    "joint_faults",
    "logged",
    "node_faults",
    "option_schema",
    "parameter_faults",
    "plugin_errors",
    "port_faults",
    "progress_reporter",
    "rigid_body_motions",
    "silent",
    "six_directions",
    "source_file",
    "spread_normal",
    "takes_context",
]
