"""Measured motions that simulations are held against, by name; none of it is in the package."""

from pytest_simbench.data.impacts import Impact, Impacts
from pytest_simbench.data.measured import DataError, DataMissing, Half
from pytest_simbench.data.sets import read
from pytest_simbench.data.tosses import Toss, Tosses

__all__ = ["DataError", "DataMissing", "Half", "Impact", "Impacts", "Toss", "Tosses", "read"]
