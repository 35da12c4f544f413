"""The run folder: what is recorded, read back, merged, resumed and compared."""
