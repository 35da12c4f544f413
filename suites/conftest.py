"""These take long: they run where somebody names their file, and not with all suites."""

collect_ignore = ["test_claims.py", "test_contact.py"]
