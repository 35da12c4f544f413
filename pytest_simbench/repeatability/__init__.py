"""Same scene, same commands, same result? And how small a change is enough to change it?

Replay, perturbation, adversarial search, sensitivity, and agreement between simulators. Nothing
is imported here: Hypothesis loads `profiles` whenever it is imported itself.
"""
