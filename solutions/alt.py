"""What a figure shows, in words, for readers who cannot see it.

In: a figure of a notebook that is executed for the book. Out: its titles, the names of its axes and
lines, as the figure has them. `install` makes Jupyter's kernel put them beside each figure, where
the book's pages take their alt texts from.
"""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text


def words(figure: Figure) -> str:
    """The figure's panels, a sentence each; those without a word of their own are counted."""
    said = [panel(axis) for axis in figure.axes]
    plain = sum(not s for s in said)
    counted = {0: [], 1: ["A picture"]}.get(plain, [f"{plain} pictures"])
    return ". ".join(filter(None, [figure.get_suptitle(), *said, *counted])) + "."


def panel(axis: Axes) -> str:
    """What a panel's title, axes and legend say, or its texts; empty if nothing is said."""
    x, y = axis.get_xlabel(), axis.get_ylabel()
    if axis.get_label() == "<colorbar>":
        return f"Colours: {y or x}"
    over = f"{y} over {x}" if x and y else y or x
    names = [name for name in axis.get_legend_handles_labels()[1] if name]
    said = [axis.get_title(), over if axis.axison else "", ", ".join(names)]
    told = ": ".join(" ".join(part.split()) for part in said if part)
    return told or ", ".join(" ".join(t.get_text().replace("$", "").split()) for t in written(axis))


def written(axis: Axes) -> list[Text]:
    """What is written in a panel that has no axes, as in a diagram; in others, numbers mostly."""
    return [] if axis.axison else [text for text in axis.texts if text.get_text()]


def install() -> None:
    """Make the running kernel's figures carry their words."""
    import matplotlib.pyplot  # noqa: F401  (the kernel's own drawing comes with it)
    from IPython import get_ipython
    from matplotlib_inline.backend_inline import configure_inline_support

    shell = get_ipython()
    configure_inline_support(shell, "module://matplotlib_inline.backend_inline")
    png = shell.display_formatter.formatters["image/png"]
    draw = png.lookup_by_type(Figure)
    png.for_type(Figure, lambda figure: (draw(figure), {"alt": words(figure)}))
