"""Beam elements for parts of your own: sections, materials, and the matrices of elements and chains.

`spatial_element_matrices` gives an element that bends in two planes, extends and twists, and `spatial_chain` joins
elements end to end. `element_matrices` and `chain` are those of a beam that bends in one plane.
"""

from dovetail_plugins.spatial_beam import (
    SpatialSection,
    spatial_chain,
    spatial_element_matrices,
    torsion_of_rectangle,
)
from dovetail_plugins.timoshenko import (
    CrossSection,
    Material,
    Section,
    chain,
    circle,
    element_matrices,
    rectangle,
)

__all__ = [
    "CrossSection",
    "Material",
    "Section",
    "SpatialSection",
    "chain",
    "circle",
    "element_matrices",
    "rectangle",
    "spatial_chain",
    "spatial_element_matrices",
    "torsion_of_rectangle",
]
