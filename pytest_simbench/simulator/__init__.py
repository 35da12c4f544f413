"""What an adapter implements, its settings, capabilities and report of the world it built."""

from pytest_simbench.description.urdf import PreparedRobot
from pytest_simbench.ground.errors import (
    DescriptionError,
    DivergedError,
    EngineError,
    NotSupportedError,
    ParityError,
    PolicyError,
    SettingsError,
    SimulatorError,
    StateError,
    UnavailableError,
)
from pytest_simbench.records.tuned_on import Seen
from pytest_simbench.simulator.base import Simulator, chosen_on, heavy, lazy_import
from pytest_simbench.simulator.info import FOLLOWER, Capability, Deviation, SimulatorInfo
from pytest_simbench.simulator.settings import Settings

__all__ = [
    "FOLLOWER",
    "Capability",
    "DescriptionError",
    "Deviation",
    "DivergedError",
    "EngineError",
    "NotSupportedError",
    "ParityError",
    "PolicyError",
    "PreparedRobot",
    "Seen",
    "Settings",
    "SettingsError",
    "Simulator",
    "SimulatorError",
    "SimulatorInfo",
    "StateError",
    "UnavailableError",
    "chosen_on",
    "heavy",
    "lazy_import",
]
