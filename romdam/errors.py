"""The errors romdam raises; each message names the place, the value, the limit and the remedy."""


class RomdamError(Exception):
    """Base of every error that a user's input or model can cause."""


class ConfigError(RomdamError):
    """A configuration file, or the scene it describes, is wrong."""


class RecordError(RomdamError):
    """A ground-motion record cannot be used."""


class MeshError(RomdamError):
    """A mesh file or a generated mesh cannot be used."""


class ReductionError(RomdamError):
    """A block cannot be reduced as asked."""


class ConvergenceError(RomdamError):
    """An equilibrium or a time step did not converge."""


class ResultError(RomdamError):
    """A result or model file cannot be read or written."""
