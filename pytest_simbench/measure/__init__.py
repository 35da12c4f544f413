"""Resources, records, statistics and verdicts: what repetitions cost, and what they prove.

Modules: `metrics` (what can be measured), `records` (one repetition, one JSON line), `resources`
(CPU and memory from outside), `intervals`, `comparison` and `power` (statistics on scipy),
`verdicts` (supported, refuted, inconclusive), `results` (the set of repetitions with its
assertions), `gate` (did it get worse than a baseline?). Nothing here is imported when pytest
loads the plugin: scipy alone takes about a second.
"""
