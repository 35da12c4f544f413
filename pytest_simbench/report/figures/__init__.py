"""Pictures of a run, drawn by matplotlib, an optional extra."""
