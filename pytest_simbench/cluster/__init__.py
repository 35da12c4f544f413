"""Repetitions on several machines, by Dask distributed.

- `offers`: what a machine has, and whether that is what a run needs.
- `job`: a test's repetitions as data, and what comes back of each.
- `node`: carries a repetition out, on the node.
- `pool`: the nodes as a client sees them; each job goes to one that has a free slot.
- `executor.ClusterExecutor`: the executor that does all this for the repeater.
- `serving`: `simbench cluster head` and `node`.

A whole repetition goes to a node. There execnet starts the simulator's worker and its resources are
sampled, as on one machine. Nothing here imports Dask before a cluster is asked for.
"""
