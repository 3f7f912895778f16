"""The one family of errors: each message names the thing, the value and what would be right."""


class RigError(Exception):
    """Anything that the user of the rig can mend; shown as one sentence, never a traceback."""


class ParameterError(RigError, ValueError):
    """A value given by the user that cannot be used."""


class SignalError(RigError, ValueError):
    """A trace or a stream that cannot be evaluated."""


class FileError(RigError):
    """A file that cannot be read, understood or written."""


class DeviceError(RigError):
    """A device, real or virtual, that does not do what it was asked."""


class NotDeterminedError(RigError):
    """A quantity that the data at hand do not determine."""
