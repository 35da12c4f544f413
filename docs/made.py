"""Tables and pages made of docs/data: those of the site when it is built, and the README's.

python docs/made.py                        writes the README's table and the pictures
python docs/made.py RUN...                 reads run folders into docs/data, each repetition into
                                           the CSV of its task
python docs/made.py --as RULES COMMIT RUN...
                                           the same, and stackings and throws into the published
                                           ones; RULES is a word of `published_runs.RULES`, COMMIT
                                           that of the code that ran

A table stands where a page has the line `<!-- made: WORD WORD -->`, see `TABLES`. The README has
its own in git, up to a line `<!-- end -->`. `conf.py` calls `write_pages` and `filled`.
"""

from __future__ import annotations

import csv
import re
import sys
from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path

import make_claims
import make_contact
import make_options
import make_results
import make_tasks
import make_transfer
import make_truth
from published_runs import PUBLISHED
from tables import DATA, DOCS, table

from pytest_simbench.records.folder import RunFolder
from pytest_simbench.report.markdown.run import table as markdown
from pytest_simbench.report.model.capabilities import columns

README = DOCS.parent / "README.md"
MARK = re.compile(r"<!-- made: ([\w ]+) -->\n(?:(?:(?!<!-- made:).)*?<!-- end -->\n?)?", re.S)


def planted() -> str:
    """What finds each planted fault (`benchmarks/parity.py`)."""
    with (DATA / "planted_faults.csv").open(encoding="utf-8", newline="") as file:
        heads, *rows = csv.reader(file)
    return table(heads, rows, len(heads))


TABLES: dict[str, Callable[..., str]] = {
    "arms": make_tasks.arms,
    "pushing": make_tasks.pushing,
    "tossing": make_tasks.tossing,
    "impacting": make_tasks.impacting,
    "arm_pushing": make_tasks.arm_pushing,
    "arm_following": make_tasks.arm_following,
    "source_simulations": make_tasks.source_simulations,
    "phenomena": make_truth.phenomena,
    "over_steps": make_truth.over_steps,
    "planted": planted,
    "claims": make_claims.claims,
    "contact": make_contact.contact,
    "matrix": make_transfer.matrix,
    "ranks": make_transfer.ranks,
    "options": make_options.options,
    "commands": make_options.commands,
    "marks": make_options.marks,
    "fixtures": make_options.fixture_table,
    "capabilities": lambda: markdown(columns()),
    "known_failures": make_options.known_failures,
}
"""By the first word of a mark, the others are arguments; beside those of `make_results`."""


def filled(text: str) -> str:
    """A page with its tables."""
    return MARK.sub(lambda mark: f"{_made(mark[1])}\n", text)


def _made(words: str) -> str:
    if words in make_results.TABLES:
        return make_results.TABLES[words](make_results.load())
    first, *others = words.split()
    return TABLES[first](*others)


def readme() -> str:
    """The README with its table."""
    return MARK.sub(
        lambda mark: f"<!-- made: {mark[1]} -->\n\n{_made(mark[1])}\n\n<!-- end -->\n",
        README.read_text("utf-8"),
    )


def kept_pages() -> dict[str, str]:
    """Tables whose repetitions were not kept. A line of pages.csv is one of a page: a row of a
    table where it has several cells."""
    pages: dict[str, str] = {}
    with (DATA / "pages.csv").open(encoding="utf-8", newline="") as file:
        for (page, rows), lines in groupby(csv.reader(file), lambda line: (line[0], len(line) > 2)):
            cells = [line[1:] for line in lines]
            text = table(cells[0], cells[1:]) if rows else "\n\n".join(line[0] for line in cells)
            pages[page] = f"{pages[page]}\n{text}\n" if page in pages else f"{text}\n"
    return pages


PAGES: dict[str, Callable[[], str]] = {
    **make_results.PAGES,
    "laws": make_truth.every_law,
    "law_errors": make_truth.every_error,
    "sweep": make_truth.every_step,
    **{name: lambda name=name: kept_pages()[name] for name in kept_pages()},
}
"""Of docs/data, by name."""


def write_pages() -> None:
    """Into docs/data, where git ignores them; one that says the same is left alone."""
    for name, make in PAGES.items():
        path, text = DATA / f"{name}.md", make()
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")


def read(folders: Sequence[str], **published: str) -> None:
    """Run folders into the CSVs."""
    for folder in folders:
        run = RunFolder(Path(folder)).read()
        if make_claims.read(run):
            continue
        make_transfer.read(run.records)
        laws = make_truth.SWEEP if any(r.swept for r in run.records) else make_truth.TRUTH
        for kept in (laws, make_contact.CONTACT, *make_tasks.KEPT):
            kept.read(run.records)
        for kept in PUBLISHED.values() if published else ():
            kept.read(run.records, **published)


def main(arguments: list[str]) -> None:
    if arguments[:1] == ["--as"]:
        _, rules, commit, *folders = arguments
        read(folders, rules=rules, commit=commit)
    elif arguments:
        read(arguments)
    else:
        README.write_text(readme(), "utf-8")
        make_results.draw()
        make_truth.draw()


if __name__ == "__main__":
    main(sys.argv[1:])
