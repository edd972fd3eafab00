"""Exudyn on reduced blocks that romdam exported; run by peers.py in the environment of the peers.

    python peers_exudyn.py MODEL.npz STEP OPENINGS.csv

Each block is an ObjectGenericODE2 of its Craig-Bampton matrices; every gap is a spring between the two
displacements it sees, which acts in compression alone (limit stop). The inertia of the ground's motion is set
before every step, so that no Python is called within one. Generalised-alpha of Exudyn (rho 0.9).
"""

import sys
import time
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    CoordinateSpringDamperExt,
    MarkerNodeCoordinate,
    NodeGenericData,
    NodeGenericODE2,
    ObjectGenericODE2,
)

_NEVER = 1e3  # [m] of opening, where the other limit stop stands


def main(path: str, step: float, target: str) -> None:
    """Integrate the model and write the openings of all gaps at its rows."""
    model = np.load(path)
    system = exu.SystemContainer()
    mbs = system.AddSystem()
    nodes, objects, blocks = [], [], range(int(model["blocks"]))
    for k in blocks:
        n = len(model[f"M{k}"])
        node = mbs.AddNode(
            NodeGenericODE2(
                referenceCoordinates=[0.0] * n,
                initialCoordinates=[0.0] * n,
                initialCoordinates_t=[0.0] * n,
                numberOfODE2Coordinates=n,
            )
        )
        matrices = {"massMatrix": model[f"M{k}"], "stiffnessMatrix": model[f"K{k}"]}
        objects.append(
            mbs.AddObject(
                ObjectGenericODE2(
                    nodeNumbers=[node],
                    dampingMatrix=model[f"C{k}"],
                    forceVector=model[f"force{k}"],
                    **matrices,
                )
            )
        )
        nodes.append(node)
    for left, i, right, j, gap, stiffness in model["gaps"]:
        markers = [
            mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=nodes[int(b)], coordinate=int(c)))
            for b, c in ((left, i), (right, j))
        ]
        mbs.AddObject(
            CoordinateSpringDamperExt(
                markerNumbers=markers,
                nodeNumber=mbs.AddNode(
                    NodeGenericData(initialCoordinates=[0.0] * 3, numberOfDataCoordinates=3)
                ),
                useLimitStops=True,
                limitStopsLower=-gap,
                limitStopsUpper=_NEVER,
                limitStopsStiffness=stiffness,
            )
        )
    mbs.Assemble()
    ground, rows, stride = model["ground"], [], int(model["stride"])  # (steps + 1, 3)

    def before(mbs: Any, t: float) -> bool:
        now = min(round(t / step), len(ground) - 1)
        for k in blocks:
            pushed = model[f"force{k}"] - model[f"inertia{k}"] @ ground[now]
            mbs.SetObjectParameter(objects[k], "forceVector", pushed)
        return True

    def after(mbs: Any, t: float) -> bool:
        if round(t / step) % stride == 0:
            q = [mbs.GetNodeOutput(node, exu.OutputVariableType.Coordinates) for node in nodes]
            rows.append(
                [t, *(g + q[int(b)][int(j)] - q[int(a)][int(i)] for a, i, b, j, g, _ in model["gaps"])]
            )
        return True

    mbs.SetPreStepUserFunction(before)
    mbs.SetPostStepUserFunction(after)
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = len(ground) - 1
    settings.timeIntegration.endTime = (len(ground) - 1) * step
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    begun = time.process_time()
    done = mbs.SolveDynamic(settings)
    head = ",".join(["time", *(f"opening:{k}" for k in range(len(model["gaps"])))])
    np.savetxt(target, rows, delimiter=",", header=head, comments="")
    print(f"{time.process_time() - begun:.3f} {'finished' if done else 'stopped'}")


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), sys.argv[3])
