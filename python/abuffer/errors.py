"""What can go wrong. Each message says what, where, what was got, the limit, and what to do."""


class AbufferError(Exception):
    """Base of everything that abuffer raises on purpose."""


class SceneError(AbufferError, ValueError):
    """Geometry or colours that cannot be rendered as given: names the array, the row and the value."""


class ParameterError(AbufferError, ValueError):
    """An unknown method, pipeline or option, or a value out of range: lists what is valid."""


class DeviceError(AbufferError, RuntimeError):
    """No usable adapter, a lost device, or an error that the graphics driver reports."""


class UnsupportedError(AbufferError, RuntimeError):
    """A feature that this device or installation lacks: names it."""


class CapacityError(AbufferError, MemoryError):
    """Does not fit, even tile by tile: the bytes needed, the limit, and what to lower."""


class ShaderError(AbufferError, RuntimeError):
    """Shader text of the user's own that does not compile: names its file and line."""
