"""All claims take 20 minutes: they are asked where somebody names their file."""

collect_ignore = ["test_claims.py"]
