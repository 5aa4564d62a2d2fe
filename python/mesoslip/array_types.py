"""Types of arrays: of NumPy, and of xarray, which is slow to import."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

DataArray: TypeAlias = "xr.DataArray"
Dataset: TypeAlias = "xr.Dataset"
DataTree: TypeAlias = "xr.DataTree"
Variable: TypeAlias = "xr.Variable"
