"""`replay.html`: what all simulators did on one seed, side by side in 3-D, from a run's traces.
trimesh writes the viewer, with three.js inside; it is optional and imported only when a page is
written."""

REPLAY_NAME = "replay.html"
