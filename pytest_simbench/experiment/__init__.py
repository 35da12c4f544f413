"""An experiment: a case and a task, its repetitions, and how many are needed.

- `case.Case`: one simulator in one mode with its settings, and how it is run.
- `experiment.Experiment`: a task in a case.
- `repetition.Repetition`: one of its repetitions, from launching a worker to its record.
- `executor.Executor`: where repetitions are carried out; this machine's workers are one.
- `slots.Slots`: the queue in which they wait.
- `repeater.Repeater`: many of them, one after the other or side by side.
- `sequential.SequentialResultSet`: as many as it takes to decide each claim.
- `handle.SimulatorHandle`: a simulator without a task, for interactive tests.
"""
