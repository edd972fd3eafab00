"""The hand-made systems of tests/timestepping and the small scenes of tests/reduction serve here as well."""

import sys
from pathlib import Path

for folder in ("timestepping", "reduction"):
    sys.path.insert(0, str(Path(__file__).parents[1] / folder))
