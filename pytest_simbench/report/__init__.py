"""What the run found, for people: live progress, terminal tables, Markdown, pictures.

Modules: `progress` (standard library only, used while tests run), `summary` (records to rows),
`cells` (numbers to text), `tables` (terminal), `markdown` and `figures` (run folder and docs).
"""
