"""What the grader's pages have in common: one look, by day, by night and on paper."""

from __future__ import annotations

import re
from html import escape

CSS = """
:root { color-scheme: light dark; --ink: #222; --ground: #fff; --quiet: #444; --panel: #f3f4f6;
  --line: #ccc; --right: #0072b2; --wrong: #c04a00 }
@media screen and (prefers-color-scheme: dark) {
  :root { --ink: #e6e6e6; --ground: #16181c; --quiet: #bbb; --panel: #23272e; --line: #4a4f58;
    --right: #56b4e9; --wrong: #ff9a4d }
}
body { font: 16px/1.5 system-ui, sans-serif; max-width: 46em; margin: 2em auto; padding: 0 1em;
  color: var(--ink); background: var(--ground); overflow-wrap: anywhere }
h2 { font-size: 1.1em; margin: 1.6em 0 .2em } .points { float: right }
ul { list-style: none; padding: 0 }
li { padding: .3em .6em; border-left: 4px solid; margin: .3em 0; background: var(--panel) }
.ok { border-color: var(--right) } .wrong { border-color: var(--wrong) }
.hint { display: block; color: var(--quiet) } a { color: var(--right) }
pre { background: var(--panel); padding: .5em .6em; margin: .3em 0; font-size: .85em;
  white-space: pre-wrap }
table { border-collapse: collapse; width: 100% } caption { text-align: left; color: var(--quiet) }
th, td { text-align: left; vertical-align: top; padding: .3em .5em .3em 0;
  border-bottom: 1px solid var(--line); overflow-wrap: normal }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(17em, 1fr)); gap: .6em }
.bar { display: block; height: .4em; background: var(--right) }
details { margin: .4em 0 } summary { cursor: pointer }
@media print {
  /* What is folded is open on paper, where nobody can unfold it. */
  details::details-content { content-visibility: visible !important; block-size: auto !important }
  h1, h2, h3 { break-after: avoid } tr, pre, li, p { break-inside: avoid }
}
"""


def words(text: str) -> str:
    """Text as HTML, with what stands between backticks as code."""
    return re.sub(r"`([^`\n]+)`", r"<code>\1</code>", escape(text))


def webpage(title: str, body: str) -> str:
    """An HTML page that loads nothing. title: plain text; body: HTML."""
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{escape(title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{CSS}</style><main>{body}</main></html>\n"
    )


def table(caption: str, head: list[str], rows: list[list[str]]) -> str:
    """A table of cells that are HTML. The first cell of a row names it."""
    top = "".join(f'<th scope="col">{name}</th>' for name in head)
    lines = (
        f'<tr><th scope="row">{first}</th>{"".join(f"<td>{x}</td>" for x in rest)}</tr>'
        for first, *rest in rows
    )
    return (
        f"<table><caption>{caption}</caption><thead><tr>{top}</tr></thead>"
        f"<tbody>{''.join(lines)}</tbody></table>"
    )
