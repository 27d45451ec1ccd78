"""The course is made from the notebooks in this folder.

`python -m solutions release` writes the student version to `notebooks/`, by nbgrader's own preprocessors.
`python -m solutions book` executes the solutions and writes them as web pages to `runs/book/`.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import nbformat
from nbclient.exceptions import CellExecutionError
from nbconvert import HTMLExporter, NotebookExporter
from nbconvert.preprocessors import ExecutePreprocessor
from nbgrader.preprocessors import (
    CheckCellMetadata,
    ClearHiddenTests,
    ClearOutput,
    ClearSolutions,
    ComputeChecksums,
    LockCells,
)
from traitlets.config import Config

from lbw_minimal.training import write_atomic
from tests.grade.submission import STUB

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
NOTEBOOKS = ROOT / "notebooks"
BOOK = ROOT / "runs" / "book"
TIMEOUT = 1800  # s, for one cell


def sources() -> list[Path]:
    """The solved notebooks, in order."""
    return sorted(HERE.glob("[0-9][0-9]_*.ipynb"))


def student(source: Path) -> str:
    """The student version of a solved notebook, as the text of its file."""
    steps = [ClearSolutions, LockCells, CheckCellMetadata, ClearOutput, ClearHiddenTests, ComputeChecksums]
    config = Config()
    config.NotebookExporter.preprocessors = steps
    config.ClearSolutions.code_stub = {"python": STUB}
    text, _ = NotebookExporter(config=config).from_filename(str(source))
    return text if text.endswith("\n") else text + "\n"


def release() -> None:
    """Write `notebooks/` anew."""
    for source in sources():
        write_atomic(NOTEBOOKS / source.name, student(source))


def execute(source: Path) -> nbformat.NotebookNode:
    """The solved notebook with its outputs, run where students run it. Raises CellExecutionError."""
    notebook, _ = ClearHiddenTests().preprocess(nbformat.read(source, as_version=4), {})
    where = {"metadata": {"path": str(HERE)}}
    ExecutePreprocessor(timeout=TIMEOUT, kernel_name="python3").preprocess(notebook, where)
    return notebook


def book(only: list[str]) -> int:
    """Execute and write the pages; returns how many notebooks failed."""
    BOOK.mkdir(parents=True, exist_ok=True)
    failed, rows = 0, []
    for source in sources():
        if only and source.stem[:2] not in only:
            continue
        print(source.stem, flush=True)
        try:
            notebook = execute(source)
        except CellExecutionError as e:
            print(f"{source.stem}: {e}", file=sys.stderr)
            failed += 1
            continue
        html, _ = HTMLExporter(embed_images=True).from_notebook_node(notebook)
        write_atomic(BOOK / f"{source.stem}.html", html)
        title = notebook.cells[0].source.splitlines()[0].lstrip("# ")
        rows.append(f'<li><a href="{source.stem}.html">{title}</a></li>')
    page = '<!doctype html><html lang="en"><meta charset="utf-8"><title>LbW minimal</title>'
    write_atomic(
        BOOK / "index.html", f"{page}<h1>LbW minimal, the course</h1><ul>{''.join(rows)}</ul></html>\n"
    )
    return failed


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m solutions", description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=["release", "book"])
    parser.add_argument("only", nargs="*", help="numbers of notebooks, such as 06; default: all")
    args = parser.parse_args()
    if args.what == "release":
        release()
        return 0
    return 1 if book(args.only) else 0


if __name__ == "__main__":
    sys.exit(main())
