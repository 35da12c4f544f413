"""Compare robot simulators with a pytest test suite."""

__version__ = "0.1.0"
