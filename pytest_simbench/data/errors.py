"""What can be wrong with a data set."""

from __future__ import annotations


class DataError(ValueError):
    """A file that is no data set, or a download that did not bring one; one sentence."""


class DataMissing(DataError):
    """A data set that is not on this machine; the sentence ends with the command that brings it."""
