"""The exceptions that the package raises on bad input, one class for each kind of input."""


class ChmarlError(Exception):
    """Base of all errors of this package: one message that names the place and how to fix it."""


class HomeError(ChmarlError, ValueError):
    """A home's layout or URDF cannot be used."""


class AssetError(ChmarlError, ValueError):
    """A URDF of a robot, a graspable object or a piece of furniture cannot be used."""


class MissingExtraError(ChmarlError, ImportError):
    """A package is not installed that only parts of this one need."""


class TaskError(ChmarlError, ValueError):
    """A task or a split does not exist, or a task cannot be set up."""


class OptionError(ChmarlError, ValueError):
    """An environment or a command got an option or a value that it does not know."""


class ActionError(ChmarlError, ValueError):
    """An action is missing, not an integer, or out of range."""


class NotResetError(ChmarlError, RuntimeError):
    """The environment was used before ``reset`` or after the end of its episode."""


class ResultError(ChmarlError, ValueError):
    """A file of results or of an episode is missing, damaged, or does not fit this version."""


class DatasetError(ChmarlError, ValueError):
    """A data set is missing, damaged, or does not fit this version."""


class CopyError(ChmarlError, TypeError):
    """Something that drives a PyBullet client or has processes of its own was to be copied or pickled."""


class WorkerError(ChmarlError, RuntimeError):
    """A process that was started to help has died."""


class WriteError(ChmarlError, OSError):
    """A file cannot be written: the disk is full, or refuses it for another reason."""


class BusyError(ChmarlError, RuntimeError):
    """Another process is writing the file."""
