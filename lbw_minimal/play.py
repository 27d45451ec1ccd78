"""What a notebook's reader turns and watches: sliders over a drawing, curves that grow.

Where no kernel answers, in the book, on paper and in nbconvert, a slider is a fixed strip of some
of its settings, and a curve is as it stood at its end. Only notebooks import this file: the kit
itself needs no Jupyter.
"""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium as gym
import ipywidgets
import numpy as np
from IPython.display import display
from matplotlib import rc_context
from matplotlib.figure import Figure

from lbw_minimal.pictures import COLOURS, STYLE, data_uri, picture

SIDE = 3.1  # inches, of one setting's drawing


class Sliders:
    """A drawing with sliders; as a notebook's value it shows itself.

    draw(axis, **settings) draws one setting into a Matplotlib axis. sliders: name -> the values it
    can have, of which the middle one comes first. shown: the settings of the strip; without them
    they are spread over the values of a single slider. size: inches of one drawing.
    """

    def __init__(
        self,
        draw: Callable[..., object],
        sliders: Mapping[str, Sequence[Any]],
        shown: Sequence[Mapping[str, Any]] = (),
        size: tuple[float, float] = (SIDE, SIDE),
    ):
        self.draw, self.size = draw, size
        self.shown = shown or spread_settings(sliders)
        self.sliders = {name: slider(name, values) for name, values in sliders.items()}
        self.image = ipywidgets.HTML()
        for part in self.sliders.values():
            part.observe(self.turn, "value")
        self.turn()
        self.widget = ipywidgets.VBox([*self.sliders.values(), self.image])

    def turn(self, _: object = None) -> None:
        """Draw what the sliders say."""
        settings = {name: part.value for name, part in self.sliders.items()}
        drawn = data_uri("image/png", png(self.figure([settings], larger=1.5)))
        self.image.value = picture(drawn, f"The drawing for {said(settings)}")

    def figure(self, settings: Sequence[Mapping[str, Any]], larger: float = 1.0) -> Figure:
        """Drawings of some settings, side by side."""
        wide, high = (larger * inches for inches in self.size)
        with rc_context(STYLE | {"axes.grid": False}):
            figure = Figure(figsize=(wide * len(settings), high))
            axes = figure.subplots(1, len(settings), squeeze=False)[0]
            for axis, setting in zip(axes, settings, strict=True):
                self.draw(axis, **setting)
        return figure

    def _repr_mimebundle_(self, **_: object) -> tuple[dict[str, Any], dict[str, Any]]:
        """The sliders where they can be turned, the strip everywhere else."""
        alive = self.widget._repr_mimebundle_()
        alt = "One drawing for each of " + "; ".join(map(said, self.shown)) + "."
        return alive | {"image/png": png(self.figure(self.shown))}, {"image/png": {"alt": alt}}


def slider(name: str, values: Sequence[Any]) -> ipywidgets.SelectionSlider:
    """A slider over some values, which starts in their middle."""
    options = [(f"{value:g}", value) for value in values]
    start = values[len(values) // 2]
    wide = ipywidgets.Layout(width="30rem", max_width="100%")
    return ipywidgets.SelectionSlider(options=options, value=start, description=name, layout=wide)


def spread_settings(sliders: Mapping[str, Sequence[Any]], n: int = 4) -> list[dict[str, Any]]:
    """n settings that are spread over the values of the only slider.

    Raises ValueError if there are more sliders than one: nobody could guess what to show.
    """
    if len(sliders) != 1:
        raise ValueError(f"{len(sliders)} sliders: say by `shown` which settings the strip has.")
    ((name, values),) = sliders.items()
    return [{name: values[i]} for i in np.linspace(0, len(values) - 1, n).round().astype(int)]


def said(settings: Mapping[str, Any]) -> str:
    """A setting in words, such as "x 0.1, y 2"."""
    return ", ".join(f"{name} {value:g}" for name, value in settings.items())


def png(figure: Figure) -> bytes:
    """A figure as a PNG, at a screen's usual 96 pixels an inch."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=96)
    return out.getvalue()


class Curves:
    """Curves that grow while something is learnt, drawn anew every two seconds at most."""

    def __init__(self, x: str, y: str, every: float = 2.0):
        self.x, self.y, self.every = x, y, every
        self.lines: dict[str, list[tuple[float, float]]] = {}
        self.handle, self.drawn = None, -np.inf

    def add(self, name: str, x: float, y: float) -> None:
        """One more point of the curve with that name."""
        self.lines.setdefault(name, []).append((x, y))
        if time.monotonic() - self.drawn > self.every:
            self.show()

    def show(self) -> None:
        """Draw the curves as they stand now; the last call's drawing stays."""
        if self.handle is None:
            self.handle = display(self.figure(), display_id=True)
        else:
            self.handle.update(self.figure())
        self.drawn = time.monotonic()

    def figure(self) -> Figure:
        """The curves, in the order in which they began."""
        with rc_context(STYLE):
            figure = Figure(figsize=(6.4, 3))
            axis = figure.subplots()
            for k, (name, points) in enumerate(self.lines.items()):
                colour = COLOURS[(1, 4, 2, 3, 0, 5)[k % 6]]
                axis.plot(*zip(*points, strict=True), ".-", ms=4, lw=1.2, color=colour, label=name)
            axis.set(xlabel=self.x, ylabel=self.y)
            if len(self.lines) > 1:
                axis.legend(loc="lower right")
        return figure


class Told(gym.Wrapper):
    """`env`, which tells `told(steps so far, return)` at the end of each of its episodes.

    Those that begin after `most` steps are not told: they test what was learnt.
    """

    def __init__(self, env: gym.Env, told: Callable[[int, float], None], most: int):
        super().__init__(env)
        self.told, self.most, self.steps, self.begun, self.earned = told, most, 0, 0, 0.0

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        self.begun, self.earned = self.steps, 0.0
        return self.env.reset(**options)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take a step, and tell if it was the episode's last."""
        obs, reward, terminal, truncated, info = self.env.step(action)
        self.steps, self.earned = self.steps + 1, self.earned + float(reward)
        if (terminal or truncated) and self.begun < self.most:
            self.told(self.steps, self.earned)
        return obs, reward, terminal, truncated, info
