"""Which settings give this truth for the least cost? A search, its front, and the verdict on what
it was not chosen on. Optuna is imported when a search begins."""
