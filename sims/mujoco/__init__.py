"""MuJoCo: the adapter, its pictures, and what the parity check reads."""
