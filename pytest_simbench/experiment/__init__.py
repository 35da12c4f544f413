"""An experiment: a case and a task, its repetitions, and how many are needed."""
