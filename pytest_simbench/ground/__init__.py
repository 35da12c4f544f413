"""What everybody needs: errors, versions, names and reading of files, text that is safe to show."""
