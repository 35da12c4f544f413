"""What can go wrong in a simulator, as types that keep their name across the process boundary."""

from __future__ import annotations


class SimulatorError(Exception):
    """Base of every error raised on behalf of a simulator. Its message may quote any file or log:
    whoever shows it makes it harmless (`ground.text`)."""


class SettingsError(SimulatorError):
    """An unknown setting or profile, or a value that it cannot take."""


class DescriptionError(SimulatorError):
    """A robot description that cannot be read or used."""


class ParityError(SimulatorError):
    """The engine built another world than the scene describes."""


class DivergedError(SimulatorError):
    """The state holds a value that is not a finite number."""


class StateError(SimulatorError):
    """An adapter returned what is no state of the scene: its shape, type or order is wrong."""


class NotSupportedError(SimulatorError):
    """The adapter was asked for something that its engine does not have."""


class PolicyError(SimulatorError):
    """A policy raised, stalled, or answered what is no command."""


class UnavailableError(SimulatorError):
    """This machine lacks what was asked for, a driver for instance; the message says what helps."""


class EngineError(SimulatorError):
    """An exception out of the engine or its adapter; the message names its type."""
