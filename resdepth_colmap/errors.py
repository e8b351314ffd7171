"""The errors that a user can cause; all others are bugs and keep their traceback."""


class ResDepthError(Exception):
    """Root of the errors of the package: one clear line, shown with exit code 1."""


class WorkspaceError(ResDepthError, OSError):
    """A workspace, or a file in it, is missing, broken or of a kind we do not read."""


class ConfigError(ResDepthError, ValueError):
    """An option is out of range or contradicts another one."""


class WeightsError(ResDepthError, ValueError):
    """A weights file is corrupt, foreign or does not fit the network."""


class BackendUnavailableError(ResDepthError, RuntimeError):
    """A requested device, library or program is not on this machine."""


class FusionError(ResDepthError, RuntimeError):
    """No point survived the fusion."""


class TrainingError(ResDepthError, RuntimeError):
    """The training cannot go on: no data, or a loss that is not a number."""
