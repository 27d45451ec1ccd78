"""Tables as CSV, for people who open them in a spreadsheet."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable


def sheet(head: list[str], rows: Iterable[list]) -> str:
    """CSV of a head and rows, whose text is `harmless`; a number is written as it is, None as an
    empty cell."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows([harmless(x) if isinstance(x, str) else x for x in row] for row in rows)
    return text.getvalue()


def harmless(text: str) -> str:
    """Text for a spreadsheet, which would take what begins with = + - @ for a formula; some take a
    semicolon or a line break for the end of a cell."""
    return re.sub(r"(^|[;,\t\n])(\s*)(?=[=+\-@\uff1d\uff0b\uff0d\uff20])", r"\1\2'", text)
