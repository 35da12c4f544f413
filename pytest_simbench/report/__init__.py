"""What a run found, for people. `model` computes it once; the other rooms only draw it.

- `model`: rows, differences, sentences, tables and claims of a run.
- `terminal`, `markdown`, `page` (`report.html`), `figures` and `replay` (`replay.html`): each
  draws it in one medium.
- `files`: writes all files of a run folder.
"""
