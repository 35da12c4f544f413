"""The comparison itself, as readable tests."""
