"""What can go wrong in a simulator, as types that keep their name across the process boundary."""

from __future__ import annotations


class SimulatorError(Exception):
    """Base of every error raised on behalf of a simulator."""


class SettingsError(SimulatorError):
    """An unknown setting or profile, or a value that it cannot take."""


class DescriptionError(SimulatorError):
    """A robot description that cannot be read or used."""


class ParityError(SimulatorError):
    """The engine built another world than the scene describes."""


class DivergedError(SimulatorError):
    """The state holds a value that is not a finite number."""


class NotSupportedError(SimulatorError):
    """The adapter was asked for something that its engine does not have."""


class EngineError(SimulatorError):
    """An exception out of the engine or its adapter; the message names its type."""


ERRORS: dict[str, type[SimulatorError]] = {
    error.__name__: error
    for error in (
        SettingsError,
        DescriptionError,
        ParityError,
        DivergedError,
        NotSupportedError,
        EngineError,
    )
}
"""The errors that a worker may report, by the name they travel under."""
