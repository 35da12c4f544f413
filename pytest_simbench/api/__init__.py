"""A comparison from Python, for scripts and notebooks: `running.run`, `result.load`. No pytest."""
