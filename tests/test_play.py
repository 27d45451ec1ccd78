"""Sliders and curves of the notebooks: what is shown with a kernel, without one, and on the way."""

import gymnasium as gym
import ipywidgets
import nbformat
import numpy as np
import pytest

from lbw_minimal import play
from lbw_minimal.play import Curves, Sliders, Told
from solutions import __main__ as course

WIDGET = "application/vnd.jupyter.widget-view+json"


def noted(log):
    """A drawing that notes its settings."""

    def draw(axis, **settings):
        log.append(settings)
        axis.plot([0, 1])

    return draw


def test_a_slider_that_is_turned_draws_its_value():
    log = []
    sliders = Sliders(noted(log), {"a": (1, 2, 3), "b": (0.5, 1.5)}, [{"a": 1, "b": 0.5}])
    assert log == [{"a": 2, "b": 1.5}]  # each starts in the middle
    sliders.sliders["a"].value = 3
    assert log[1:] == [{"a": 3, "b": 1.5}]
    assert 'alt="The drawing for a 3, b 1.5"' in sliders.image.value
    assert sliders.image in sliders.widget.children and len(sliders.widget.children) == 3


def test_where_no_kernel_answers_some_settings_stand_side_by_side():
    log = []
    data, said = Sliders(noted(log), {"a": range(10)})._repr_mimebundle_()
    assert [row["a"] for row in log[1:]] == [0, 3, 6, 9]
    assert {WIDGET, "image/png"} <= set(data) and data["image/png"].startswith(b"\x89PNG")
    assert said["image/png"]["alt"] == "One drawing for each of a 0; a 3; a 6; a 9."


def test_two_sliders_have_to_be_told_what_the_strip_shows():
    with pytest.raises(ValueError, match="2 sliders: say by `shown`"):
        Sliders(noted([]), {"a": (1, 2), "b": (1, 2)})


SLIDER = """
from lbw_minimal.play import Sliders, Curves
Sliders(lambda axis, a: axis.plot([0, a]), {"a": (1, 2, 3)})
"""
CURVE = """
curves = Curves("step", "return", every=0.0)
for i in range(5):
    curves.add("one", i, i * i)
print(len(curves.lines["one"]))
"""


def test_in_the_book_a_slider_is_its_strip_and_a_curve_its_end(tmp_path):
    here = f"import sys\nsys.path.insert(0, {str(course.ROOT)!r})"
    cells = [nbformat.v4.new_code_cell(code) for code in (here, SLIDER, CURVE)]
    title = nbformat.v4.new_markdown_cell("# 1. x\n\n**The question.** Why?\n\nText.")
    path = tmp_path / "01_x.ipynb"
    nbformat.write(nbformat.v4.new_notebook(cells=[title, *cells]), path)
    done = course.execute(path)
    (shown,), (curve, _) = done.cells[2].outputs, done.cells[3].outputs
    assert WIDGET in shown.data and "image/png" in shown.data
    assert curve.output_type == "display_data" and "image/png" in curve.data
    html = course.page(done, path)
    assert html.count("<img") == 2 and 'alt="One drawing for each of a 1; ' in html
    assert WIDGET not in html and "https://cdn" not in html


def test_curves_keep_every_point_and_are_drawn_no_oftener_than_asked(monkeypatch):
    now, drawn = [0.0], []
    monkeypatch.setattr(play.time, "monotonic", lambda: now[0])
    curves = Curves("step", "return", every=2.0)
    monkeypatch.setattr(
        curves, "show", lambda: (drawn.append(now[0]), setattr(curves, "drawn", now[0]))
    )
    for now[0] in (1.0, 2.0, 3.5, 4.0):
        curves.add("a", now[0], -now[0])
    assert drawn == [1.0, 3.5]
    (line,) = curves.figure().axes[0].lines
    np.testing.assert_array_equal(line.get_xydata(), [(t, -t) for t in (1.0, 2.0, 3.5, 4.0)])


class Three(gym.Env):
    """Episodes of three steps, each of which pays 2."""

    observation_space = action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        self.left = 3
        return 0, {}

    def step(self, action):
        self.left -= 1
        return 0, 2, False, self.left == 0, {}


def test_episodes_of_the_training_are_told_and_those_after_it_are_not():
    told = []
    env = Told(Three(), lambda steps, earned: told.append((steps, earned)), 5)
    for _ in range(4):
        env.reset()
        while not env.step(0)[3]:
            pass
    assert told == [(3, 6.0), (6, 6.0)] and env.steps == 12


def test_a_slider_can_be_used_by_its_keys_and_says_its_name():
    part = play.slider("sigma", (0.1, 0.2, 0.3))
    assert isinstance(part, ipywidgets.SelectionSlider)
    assert part.description == "sigma" and [name for name, _ in part.options] == [
        "0.1",
        "0.2",
        "0.3",
    ]
