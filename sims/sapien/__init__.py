"""SAPIEN: the adapter, its drawing scene, and what the parity check reads."""
