"""Data models of other packages: labelled arrays of xarray, names of SDyPy, tables of pyFBS."""

from dovetail.exchange.labelled_arrays import from_xarray, to_xarray
from dovetail.exchange.pyfbs_tables import PyfbsTables, from_pyfbs, to_pyfbs
from dovetail.exchange.sdypy_names import from_sdypy, from_sep005, to_sdypy, to_sep005

__all__ = [
    "PyfbsTables",
    "from_pyfbs",
    "from_sdypy",
    "from_sep005",
    "from_xarray",
    "to_pyfbs",
    "to_sdypy",
    "to_sep005",
    "to_xarray",
]
