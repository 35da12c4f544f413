"""Statistics and verdicts: what repetitions prove. scipy is imported where it is used alone."""
