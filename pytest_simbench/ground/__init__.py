"""What everybody needs: versions of simulators, names of files, text that is safe to show."""
