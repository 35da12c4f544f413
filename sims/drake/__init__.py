"""Drake: the adapter, the world with its corner spheres, and what the parity check reads."""
