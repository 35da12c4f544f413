"""`report.html`: one file that a browser opens offline, made from a run folder's records.

Modules: `context` (what the page tells), `strips` (a dot for each repetition), `setup` (with what
the run was made), `pictures` (matplotlib's, as SVG), `render` (HTML). Jinja2 is imported only when
a page is written.
"""

PAGE_NAME = "report.html"
