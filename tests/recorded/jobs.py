"""Recorded jobs: the commands of each, run in a folder that holds what `jobs/<name>` does.

A number before a command is the exit code that it ends with.
"""

JOBS: dict[str, tuple[str, ...]] = {
    "blocks": (
        "check blocks.yaml",
        "check blocks.yaml --json",
        "run blocks.yaml --out out",
        "info out/late.nc --json",
        "report out/one.nc",
        "report out/two.nc --units us",
        "plot out/two.nc --fields --vtu --frames 2 --out figures",
        "compare out/one.nc out/two.nc --out compared",
        "2 certify out/one.nc",
        "1 stability blocks.yaml out/one.nc out/two.nc --out out",
        "show blocks.yaml --out figures",
    ),
    "gravity": (
        "check gravity.yaml --quick",
        "run gravity.yaml --out out",
        "info out/one.nc",
        "report out/one.nc",
        "1 combinations gravity.yaml --out combined",
    ),
    "arch": (
        "check arch.yaml --quick",
        "run arch.yaml --out out",
        "certify out/one.nc",
        "wedges wedges.yaml out/one.nc --out wedges",
        "report out/one.nc --validation",
    ),
    "laws": (
        "run laws.yaml --out out",
        "run modal.yaml --out modal",
        "run full.yaml --out full",
        "run undamped.yaml --out undamped",
        "compare modal/one.nc out/one.nc --json",
    ),
    "ground": (
        "run inclined.yaml --out inclined",
        "run free.yaml --out free",
        "run viscous.yaml --out viscous",
        "run along.yaml --out along",
        "run wave.yaml --out wave",
        "run moved.yaml --out moved",
    ),
    "suite": (
        "run suite.yaml --out out --workers 1",
        "report out --threshold 0.2mm --response peak_opening",
        "run sobol.yaml --out sobol --workers 1",
        "run compared.yaml --out compared",
        "clean suite.yaml --out out",
    ),
    "records": (
        "records records.yaml --plot figures",
        "records records.yaml --json",
        "records formats.yaml",
    ),
    "linear": (
        "linear hysteretic.yaml --out hysteretic",
        "modes linear.yaml --out modes --count 4 --measured measured.csv",
        "modes linear.yaml --out bonded --count 3 --joints bonded --vtu",
        "run linear.yaml --out run",
        "verify linear.yaml --out verify --duration 0.3s",
        "study linear.yaml --out study",
    ),
    "export": (
        "export nodes.yaml --to opensees --out opensees --duration 0.1",
        "export undeformed.yaml --to calculix --out calculix --duration 0.1",
        "export export.yaml --to abaqus --out abaqus --duration 0.1",
        "export export.yaml --to code_aster --out code_aster --duration 0.1",
        "export export.yaml --to matrices --out matrices",
    ),
}
