"""The built-in components of Dovetail, registered by the same hook as those of any plugin."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

import dovetail


@dovetail.hookimpl
def dovetail_components() -> list[type[dovetail.Component]]:
    """Return the built-in components; they are imported here, so that the list of commands does not wait for them."""
    from dovetail_plugins.laws import LAWS

    return [
        *_substructures(),
        *_joints(),
        *_estimators(),
        *_methods(),
        *_readers(),
        *_matrix_readers(),
        *LAWS,
    ]


def _substructures() -> list[type[dovetail.Component]]:
    from dovetail_plugins.substructures.ground import Ground
    from dovetail_plugins.substructures.lumped import Lumped
    from dovetail_plugins.substructures.matrices import Matrices
    from dovetail_plugins.substructures.measured import Measured
    from dovetail_plugins.substructures.rigid_body import RigidBody
    from dovetail_plugins.substructures.spatial_beam import SpatialBeam
    from dovetail_plugins.substructures.timoshenko_beam import TimoshenkoBeam

    return [TimoshenkoBeam, SpatialBeam, RigidBody, Lumped, Ground, Measured, Matrices]


def _joints() -> list[type[dovetail.Component]]:
    from dovetail_plugins.joints.bearing import Bearing
    from dovetail_plugins.joints.bolted import Bolted
    from dovetail_plugins.joints.bushing import Bushing
    from dovetail_plugins.joints.collet import Collet
    from dovetail_plugins.joints.interference_fit import InterferenceFit
    from dovetail_plugins.joints.rigid import BallJoint, Hinge, Rigid, RigidLink
    from dovetail_plugins.joints.spring_damper import SpringDamper
    from dovetail_plugins.joints.strut import Strut

    springs = (Collet, Bolted, InterferenceFit, Bearing, SpringDamper, Bushing, Strut)
    return [*springs, Rigid, BallJoint, Hinge, RigidLink]


def _estimators() -> list[type[dovetail.Component]]:
    from dovetail_plugins.reducers.none import NoReducer
    from dovetail_plugins.reducers.pca import PCA
    from dovetail_plugins.reducers.scikit_learn import Transformer
    from dovetail_plugins.reducers.umap import UMAP
    from dovetail_plugins.regressors.flow import Flow
    from dovetail_plugins.regressors.mlp import MLP
    from dovetail_plugins.regressors.scikit_learn import ScikitLearnRegressor

    return [UMAP, PCA, NoReducer, Transformer, MLP, Flow, ScikitLearnRegressor]


def _methods() -> list[type[dovetail.Component]]:
    from dovetail_plugins.methods.multistart import Multistart
    from dovetail_plugins.methods.network import Network
    from dovetail_plugins.methods.posterior import PosteriorMethod
    from dovetail_plugins.methods.refined import Refined

    return [PosteriorMethod, Refined, Multistart, Network]


def _readers() -> list[type[dovetail.Component]]:
    from dovetail_plugins.readers.cutpro import CutProReader
    from dovetail_plugins.readers.hdf5 import Hdf5Reader
    from dovetail_plugins.readers.labview import LabViewReader
    from dovetail_plugins.readers.matlab import MatlabReader
    from dovetail_plugins.readers.numpy_files import NpyReader, NpzReader
    from dovetail_plugins.readers.text import TextReader
    from dovetail_plugins.readers.uff import UffReader

    return [UffReader, TextReader, NpzReader, NpyReader, MatlabReader, Hdf5Reader, CutProReader, LabViewReader]


def _matrix_readers() -> list[type[dovetail.Component]]:
    from dovetail_plugins.matrix_readers.abaqus import AbaqusInputReader, AbaqusMatrixReader
    from dovetail_plugins.matrix_readers.ansys import (
        AnsysFullReader,
        AnsysMappingReader,
        AnsysNodesReader,
        HarwellBoeingReader,
    )
    from dovetail_plugins.matrix_readers.archives import ArchiveReader, MatrixMarketReader
    from dovetail_plugins.matrix_readers.nastran import NastranBulkReader
    from dovetail_plugins.matrix_readers.op4 import Op4Reader

    nastran, abaqus = (NastranBulkReader, Op4Reader), (AbaqusMatrixReader, AbaqusInputReader)
    ansys = (HarwellBoeingReader, AnsysMappingReader, AnsysNodesReader, AnsysFullReader)
    return [ArchiveReader, MatrixMarketReader, *nastran, *abaqus, *ansys]


@dovetail.hookimpl
def dovetail_defaults() -> dict[str, Any]:
    """Return the contents of ``defaults.yaml``."""
    import yaml

    text = (files("dovetail_plugins") / "defaults.yaml").read_text(encoding="utf-8")
    defaults: dict[str, Any] = yaml.safe_load(text)
    return defaults
