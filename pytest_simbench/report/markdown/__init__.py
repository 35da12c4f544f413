"""The report as GitHub Markdown, and what else GitHub shows: a job's summary, a badge."""
