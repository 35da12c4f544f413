"""`report.html`: one file that a browser opens offline, made from a run folder's records. Jinja2 is
imported only when a page is written."""

PAGE_NAME = "report.html"
