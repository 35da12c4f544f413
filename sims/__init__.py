"""The adapters, a package an engine: the only code that imports a simulator."""
