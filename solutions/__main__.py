"""The course is made from the notebooks in this folder.

`python -m solutions release` writes the student version to `notebooks/`, by nbgrader's own
preprocessors, and the glossary beside it. `python -m solutions archive` writes the kit without the
solved notebooks to `runs/lbw.zip`, for students. `python -m solutions book` executes the solutions
and writes them as web pages to `runs/book/`, which need no network: equations are MathML, pictures
and scenes are in the pages. `python -m solutions gradescope 06` writes what grades a notebook on
Gradescope to `runs/autograder.zip`.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from html import escape
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import nbformat
from latex2mathml.converter import convert
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

from lbw_minimal.report_texts import CSS, HTML
from lbw_minimal.training import InputError, write_atomic
from tasks.commands.links import links
from tests.grade import gradescope
from tests.grade.cell.answer import STUB

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
NOTEBOOKS, GLOSSARY = ROOT / "notebooks", HERE / "GLOSSARY.md"
LECTURER = HERE / "LECTURER.md"  # exam questions with answers
BOOK, ARCHIVE = ROOT / "runs" / "book", ROOT / "runs" / "lbw.zip"
AUTOGRADER = ROOT / "runs" / "autograder.zip"
TIMEOUT = 1800  # s, for one cell
# What the kernel does before the first cell, for the figures' alt texts.
DESCRIBED = (f"import sys; sys.path.insert(0, {str(ROOT)!r})",
             "from solutions.alt import install; install(); sys.path.pop(0)")  # fmt: skip
STYLE = """
body { margin: 0 auto !important; max-width: 62rem; padding: 0 1rem 4rem }
nav { position: sticky; top: 0; z-index: 9; display: flex; gap: 1.5rem; padding: .6rem 1rem;
  background: var(--jp-layout-color0); border-bottom: 1px solid var(--jp-border-color2);
  font: 15px system-ui, sans-serif; flex-wrap: wrap }
nav label { margin-left: auto }
body:has(#plain:checked) .jp-InputArea:has(.jp-CodeMirrorEditor) { display: none }
body:has(#plain:checked) .jp-InputPrompt { visibility: hidden }
body:has(#plain:checked) .jp-OutputPrompt { visibility: hidden }
math[display=block] { margin: .8em 0 }
/* Within a sentence colour alone does not tell a link. */
.jp-RenderedHTMLCommon :is(p, li, td) a { text-decoration: underline !important }
img { max-width: 100% }
.jp-InputArea-editor, .jp-OutputArea-output { overflow-x: auto !important }
@media print, (max-width: 40rem) {
  pre { white-space: pre-wrap !important; overflow-wrap: anywhere }
}
.jp-InputPrompt, .jp-OutputPrompt { opacity: 1 !important }
details { border-left: 3px solid var(--jp-border-color2); padding-left: .8rem; margin: .6rem 0 }
summary { cursor: pointer; color: var(--jp-ui-font-color1) }
/* nbconvert's colours, dark enough for small type on grey: 4.5 to 1 and more */
@media not screen, not (prefers-color-scheme: dark) {
  .highlight .o, .highlight .ow { color: #8414c8 !important }
  .highlight .c1 { color: #356e6e !important }
  .highlight .mi, .highlight .mf { color: #007000 !important }
}
@media print {
  nav, iframe { display: none !important }
  /* What is folded is open on paper, where nobody can unfold it. */
  details::details-content { content-visibility: visible !important; block-size: auto !important }
  .jp-InputArea-editor, .jp-OutputArea-output { overflow: visible !important }
  figure, img, tr { break-inside: avoid }
  math[display=block] { font-size: .78em }
  h1, h2, h3 { break-after: avoid }
}
"""
DARK = """
:root { color-scheme: dark }
body { background: var(--jp-layout-color0) }
.highlight .o, .highlight .ow { color: #d0a6ff !important }
.highlight .c1 { color: #9cc4c4 !important }
.highlight .mi, .highlight .mf { color: #8ce08c !important }
"""
INDEX = """
body { font-size: 1.05rem; max-width: 46rem }
li { margin: .7rem 0; list-style: none } ul { padding: 0 } li a { font-weight: 600 }
p { margin: .1rem 0 }
"""
LINK = re.compile(r"\]\((\d\d_\w+)\.ipynb")
MATH = re.compile(r"(`+.*?`+)|\$\$(.+?)\$\$|\$([^$\n]+?)\$", re.DOTALL)
# What PyBullet prints to everybody who imports it.
GREETING = re.compile(r"(pybullet build time: .*|argv\[0\]=)\n?")


def sources() -> list[Path]:
    """The solved notebooks, in order."""
    return sorted(HERE.glob("[0-9][0-9]_*.ipynb"))


def wanted(numbers: list[str]) -> list[Path]:
    """The solved notebooks with these numbers, such as 06; all if there are none.

    Raises InputError where one is missing.
    """
    found = {source.stem[:2]: source for source in sources()}
    if not found:
        raise InputError(
            f"{HERE.name}/ has no solved notebooks here, as in the archive for students; "
            "the book and notebooks/ are made from them, in the whole kit."
        )
    for number in numbers:
        if number not in found:
            raise InputError(f"there is no notebook {number}; there are {', '.join(found)}.")
    return [found[number] for number in sorted(set(numbers))] or [*found.values()]


def student(source: Path) -> str:
    """The student version of a solved notebook, as the text of its file."""
    steps = [ClearSolutions, LockCells, CheckCellMetadata, ClearOutput]
    steps += [ClearHiddenTests, ComputeChecksums]
    config = Config()
    config.NotebookExporter.preprocessors = steps
    config.ClearSolutions.code_stub = {"python": STUB}
    text = str(NotebookExporter(config=config).from_filename(str(source))[0])
    return text if text.endswith("\n") else text + "\n"


def release() -> None:
    """Write `notebooks/` anew. Raises InputError if there are no solved notebooks."""
    for source in wanted([]):
        write_atomic(NOTEBOOKS / source.name, student(source))
    write_atomic(NOTEBOOKS / GLOSSARY.name, GLOSSARY.read_text(encoding="utf-8"))


def archive(path: Path = ARCHIVE) -> None:
    """Write the kit's own files to a zip, in a folder `lbw`, but for what `notebooks/` is made of
    and what is the lecturer's alone.

    Raises InputError if git does not know which files are the kit's.
    """
    try:
        listed = subprocess.check_output(
            ["git", "ls-files", "-z"], cwd=ROOT, text=True, stderr=subprocess.DEVNULL
        )
    except (OSError, subprocess.CalledProcessError):
        raise InputError(
            "git does not know the kit's files here; make the archive in a clone of it."
        ) from None
    path.parent.mkdir(parents=True, exist_ok=True)
    with ZipFile(path, "w", ZIP_DEFLATED) as out:
        for name in filter(None, listed.split("\0")):
            if ROOT / name not in (*sources(), GLOSSARY, LECTURER):
                out.write(ROOT / name, f"lbw/{name}")


def execute(source: Path) -> nbformat.NotebookNode:
    """The solved notebook with its outputs, its figures with their words.

    Raises CellExecutionError.
    """
    notebook, _ = ClearHiddenTests().preprocess(nbformat.read(source, as_version=4), {})
    where = {"metadata": {"path": str(HERE)}}
    kernel = ExecutePreprocessor(timeout=TIMEOUT, kernel_name="python3")
    kernel.extra_arguments = [f"--IPKernelApp.exec_lines={line}" for line in DESCRIBED]
    kernel.preprocess(notebook, where)
    return notebook


def mathml(found: re.Match) -> str:
    """What `MATH` found as MathML, which needs no script from the network; code as it is."""
    return found[1] or convert(found[2] or found[3], display="block" if found[2] else "inline")


def linked(text: str) -> str:
    """Markdown whose links to notebooks and to the glossary lead to their pages in the book."""
    return LINK.sub(r"](\1.html", text.replace(f"]({GLOSSARY.name}", "](glossary.html"))


def opening(source: Path) -> tuple[str, str]:
    """The notebook's title and its question, with equations as MathML."""
    text = nbformat.read(source, as_version=4).cells[0].source
    question = text.split("**The question.**")[1].split("\n\n")[0].strip().replace("*", "")
    return text.splitlines()[0].lstrip("# "), MATH.sub(mathml, question)


def page(notebook: nbformat.NotebookNode, source: Path) -> str:
    """An executed notebook as a web page that needs nothing else, with links to its neighbours."""
    equations = []
    notebook.metadata.pop("widgets", None)  # no kernel would answer them

    def keep(found):  # the exporter would take MathML apart
        if found[1]:
            return found[1]
        equations.append(mathml(found))
        return f"EQUATION{len(equations) - 1}HERE"

    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cell.source = MATH.sub(keep, linked(cell.source))
        for output in list(cell.get("outputs", [])):
            # A progress bar: as it stood at its end, and no error.
            if "\r" in output.get("text", ""):
                output.text, output.name = re.sub(r"[^\n]*\r", "", output.text), "stdout"
            if GREETING.fullmatch(output.get("text", "")):
                cell.outputs.remove(output)
            # nbconvert would leave out a picture's words
            if png := output.get("data", {}).get("image/png"):
                said = output.metadata.get("image/png", {}).get("alt", "")
                uri = f"data:image/png;base64,{''.join(png.split())}"
                output.data = {"text/html": f'<img alt="{escape(said)}" src="{uri}">'}
    # With embed_images each piece of HTML would be closed by itself, and what is folded be empty.
    exporter = HTMLExporter(mathjax_url="", require_js_url="")
    exporter.exclude_anchor_links = True
    name = {"metadata": {"name": escape(notebook.cells[0].source.splitlines()[0].lstrip("# "))}}
    html, _ = exporter.from_notebook_node(notebook, name)
    # Mermaid would come from the network.
    html = re.sub(r'<script type="module">.*?</script>', "", html, flags=re.DOTALL)
    html = re.sub(r"EQUATION(\d+)HERE", lambda m: equations[int(m[1])], html)
    links = ['<a href="index.html">contents</a>', '<a href="glossary.html">glossary</a>']
    order = sources()
    if source in order:  # and not the glossary
        i = order.index(source)
        for near in (*order[max(0, i - 1) : i], *order[i + 1 : i + 2]):
            links.append(f'<a href="{near.stem}.html">{opening(near)[0]}</a>')
    switch = '<label><input type="checkbox" id="plain"> hide the code</label>'
    bar = f"<nav>{''.join(links)}{switch}</nav>"
    html = html.replace("</head>", f"<style>{STYLE}{dark(exporter)}</style></head>", 1)
    return re.sub(r"(<body[^>]*>)", lambda found: found[1] + bar, html, count=1)


def dark(exporter: HTMLExporter) -> str:
    """nbconvert's dark colours, for readers whose system asks for them, on a screen."""
    folders = map(Path, exporter.template_paths)
    (theme,) = {f for p in folders for f in [p / "static" / "theme-dark.css"] if f.exists()}
    colours = theme.read_text(encoding="utf-8")
    return f"@media screen and (prefers-color-scheme: dark) {{ {colours} {DARK} }}"


def glossary() -> str:
    """The glossary as a page, whose terms can be linked to by their names."""
    cell = nbformat.v4.new_markdown_cell(GLOSSARY.read_text(encoding="utf-8"))
    html = page(nbformat.v4.new_notebook(cells=[cell]), GLOSSARY)
    named = '<h2 id="{}">{}</h2>'
    return re.sub("<h2>(.*?)</h2>", lambda m: named.format(m[1].replace(" ", "-"), m[1]), html)


def contents() -> str:
    """The page that lists all notebooks with their questions."""
    rows = []
    for source in sources():
        title, question = opening(source)
        rows.append(f'<li><a href="{source.stem}.html">{title}</a><p>{question}</p></li>')
    rows.append('<li><a href="glossary.html">Words of the field</a></li>')
    title = "LbW minimal, the course"
    body, others = (
        f"<h1>{title}</h1><ul>{''.join(rows)}</ul>",
        links(BOOK / "index.html", BOOK.parent),
    )
    return HTML.format(title=title, css=CSS + INDEX, links=others, body=body)


def book(only: list[str]) -> int:
    """Execute and write the pages; returns how many notebooks failed.

    Raises InputError if one of them is missing.
    """
    asked, failed = wanted(only), 0
    BOOK.mkdir(parents=True, exist_ok=True)
    write_atomic(BOOK / "index.html", contents())
    write_atomic(BOOK / "glossary.html", glossary())
    for i, source in enumerate(asked, 1):
        print(f"{source.stem}, {i} of {len(asked)}", flush=True)
        try:
            notebook = execute(source)
        except CellExecutionError as e:
            print(f"{source.stem}: {e}", file=sys.stderr)
            failed += 1
            continue
        write_atomic(BOOK / f"{source.stem}.html", page(notebook, source))
    return failed


def main() -> int:
    """Do what is asked; returns the exit code: 1 if a notebook failed, 2 for a mistake."""
    parser = argparse.ArgumentParser(prog="python -m solutions", description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=["release", "archive", "book", "gradescope"])
    parser.add_argument("only", nargs="*", help="numbers of notebooks, such as 06: to run, or set")
    args = parser.parse_args()
    try:
        if args.what == "book":
            failed = book(args.only)
            print(f"book: {(BOOK / 'index.html').relative_to(ROOT)}")
            return 1 if failed else 0
        if args.what == "gradescope":
            if not args.only:
                raise InputError("say which notebooks are set, as in: gradescope 06")
            gradescope.archive(AUTOGRADER, ",".join(args.only))
            print(f"for Gradescope: {AUTOGRADER.relative_to(ROOT)}")
            return 0
        if args.only:
            raise InputError(f"{args.what} takes no numbers; the book and gradescope do.")
        if args.what == "release":
            release()
        else:
            archive()
            print(f"archive: {ARCHIVE.relative_to(ROOT)}")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
