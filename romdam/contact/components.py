"""The components of a gap's jump and force, and its two tangential directions.

Displacements and forces of all gaps follow each other gap by gap, so component `SHEAR_J` of gap i stands at
3 i + SHEAR_J.
"""

from __future__ import annotations

NORMAL, SHEAR_J, SHEAR_K = 0, 1, 2  # opening or compression, and slip or shear along j and k
ALONG_J, ALONG_K = 0, 1  # of what has no normal component: friction, cohesion, accumulated slip
