"""pytest's side: hooks, options, fixtures, selection, progress."""
