"""Starts workers, talks to them, times them out, turns their death into typed errors."""
