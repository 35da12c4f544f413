"""Runs repetitions: launch, sample, perform, score, record. Knows every room but pytest's."""
