"""Print which kernels numpy's and scipy's OpenBLAS choose by themselves here; nothing where they differ."""

import numpy  # noqa: F401  loads its OpenBLAS
import scipy.linalg  # noqa: F401  loads another
from threadpoolctl import threadpool_info

chosen = {str(one.get("architecture")) for one in threadpool_info() if one["user_api"] == "blas"}
print(*(chosen if len(chosen) == 1 else ()))
