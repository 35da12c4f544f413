"""DART: the adapter, and what the parity check reads."""
