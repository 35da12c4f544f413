"""Omniverse PhysX: the adapter, the session, the stage, and what the parity check reads."""
