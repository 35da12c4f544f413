"""Genesis: the adapter, its engine's start and end, its world, and what the parity check reads."""
