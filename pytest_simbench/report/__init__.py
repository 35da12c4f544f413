"""What a run found, for people: `model` computes it once; `terminal`, `markdown`, `page`
(`report.html`), `figures` and `replay` (`replay.html`) each draw it in one medium; `files` writes
all files of a run folder."""
