"""Print the OpenBLAS kernels to test here: those that this processor can run, without its default."""

import os
import subprocess
import sys

KERNELS = ("Haswell", "SkylakeX", "Sandybridge")
# A kernel forced on a processor without its instructions ends the process (SkylakeX without AVX-512).
TRIED = """
import numpy as np
import scipy.linalg
from threadpoolctl import threadpool_info

square = np.random.default_rng(0).random((300, 300))
square @ square
scipy.linalg.lu_factor(square)
print(*{str(library["architecture"]) for library in threadpool_info() if library["user_api"] == "blas"})
"""


def taken(kernel: str | None) -> list[str]:
    """Kernels that OpenBLAS of numpy and scipy takes when asked for this one; none if they cannot run."""
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    if kernel is not None:
        environment["OPENBLAS_CORETYPE"] = kernel
    done = subprocess.run([sys.executable, "-c", TRIED], env=environment, capture_output=True, text=True)
    return done.stdout.split() if done.returncode == 0 else []


own = taken(None)
for kernel in KERNELS:
    if own == [kernel]:
        print(f"{kernel} is what `make test` takes here", file=sys.stderr)
    elif taken(kernel) != [kernel]:
        print(f"{kernel} needs instructions that this processor lacks: not tested", file=sys.stderr)
    else:
        print(kernel)
