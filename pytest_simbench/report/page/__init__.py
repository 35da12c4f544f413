"""`report.html`: one file that a browser opens offline, made from a run folder's records.

Modules: `context` (what the page tells), `cells` (its tables), `strips` (a dot for each
repetition), `pictures` (matplotlib's, as SVG), `render` (HTML). Jinja2 is imported only when a page
is written.
"""

from __future__ import annotations

from pytest_simbench.measure.gate import GateReport

PAGE_NAME = "report.html"

Compared = tuple[str, GateReport]
"""Name of a baseline, and what differs from it."""
