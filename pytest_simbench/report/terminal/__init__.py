"""The report in a terminal or a log, as plain lines of a given width, and the live progress line.

Nothing is imported here: `progress` is used while tests run.
"""
