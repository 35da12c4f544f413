"""`replay.html`: what all simulators did on one seed, side by side in 3-D, from a run's traces.

Modules: `recorded` (what a run's folder holds of its repetitions, which are shown together, and
bags for others), `render` (one HTML file). trimesh writes the viewer, with three.js inside; it is
optional and imported only when a page is written.
"""

REPLAY_NAME = "replay.html"
