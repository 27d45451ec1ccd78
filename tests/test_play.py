"""Sliders and curves of the notebooks: what is shown with a kernel, without one, and on the way."""

import base64
import re
from types import SimpleNamespace

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


def size(png):
    """Width and height in pixels, from the head of a PNG."""
    return tuple(np.frombuffer(png[16:24], ">u4").tolist())


def test_a_drawing_has_96_pixels_an_inch_and_the_one_that_is_turned_half_as_many_again():
    sliders = Sliders(noted([]), {"a": range(10)}, size=(2.0, 1.0))
    data, _ = sliders._repr_mimebundle_()
    assert size(data["image/png"]) == (4 * 2 * 96, 96)
    (turned,) = re.findall('base64,([^"]+)', sliders.image.value)
    assert size(base64.b64decode(turned)) == (1.5 * 2 * 96, 1.5 * 96)
    wide, high = size(Sliders(noted([]), {"a": range(10)})._repr_mimebundle_()[0]["image/png"])
    assert wide == pytest.approx(4 * high, abs=4)  # each is a square of 3.1 inches
    assert high == pytest.approx(3.1 * 96, abs=1)


def test_curves_have_a_grid_to_read_them_by_and_a_drawing_has_none():
    for figure, there in (
        (Curves("x", "y").figure(), True), (Sliders(noted([]), {"a": (1,)}).figure([{}]), False)
    ):  # fmt: skip
        assert figure.axes[0].get_xgridlines()[0].get_visible() == there


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


def test_a_growing_curve_is_one_drawing_that_is_shown_anew_every_two_seconds(monkeypatch):
    now, shown = [0.0], []
    handle = SimpleNamespace(update=shown.append)
    monkeypatch.setattr(play, "display", lambda figure, display_id: shown.append(figure) or handle)
    monkeypatch.setattr(play.time, "monotonic", lambda: now[0])
    curves = Curves("step", "return")
    for now[0] in (1.0, 2.0, 2.9, 3.1, 4.0):
        curves.add("a", now[0], 0)
    curves.show()
    assert [len(figure.axes[0].lines[0].get_xdata()) for figure in shown] == [1, 4, 5]


def test_curves_bear_their_names_and_colours_and_one_alone_has_no_legend():
    curves = Curves("step", "return", every=np.inf)
    curves.add("a", 0, 1)
    (axis,) = curves.figure().axes
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("step", "return")
    assert axis.get_legend() is None
    for name in "bcdef":
        curves.add(name, 0, 1)
        (axis,) = curves.figure().axes
        names = "abcdef"[: 1 + "abcdef".index(name)]
        assert [text.get_text() for text in axis.get_legend().get_texts()] == [*names]
    assert len({line.get_color() for line in axis.lines}) == 6


class Three(gym.Env):
    """Episodes of three steps, each of which pays 2. ends: which of the two flags says so."""

    ends = (False, True)  # terminal, truncated
    observation_space = action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        self.left = 3
        return 0, {}

    def step(self, action):
        self.left -= 1
        return 7, 2, *(self.left == 0 and flag for flag in self.ends), {"left": self.left}


def test_episodes_of_the_training_are_told_and_those_after_it_are_not():
    told = []
    env = Told(Three(), lambda steps, earned: told.append((steps, earned)), 5)
    for _ in range(4):
        env.reset()
        while not env.step(0)[3]:
            pass
    assert told == [(3, 6.0), (6, 6.0)] and env.steps == 12


@pytest.mark.parametrize("ends", [(True, False), (False, True)])
def test_an_episode_is_told_however_it_ends_and_nothing_of_a_step_is_changed(ends, monkeypatch):
    monkeypatch.setattr(Three, "ends", ends)
    told = []
    env = Told(Three(), lambda *what: told.append(what), 5)
    env.reset()
    steps = [env.step(0) for _ in range(3)]
    assert steps[0] == (7, 2, False, False, {"left": 2}) and steps[2] == (7, 2, *ends, {"left": 0})
    assert told == [(3, 6.0)]


def test_a_slider_can_be_used_by_its_keys_and_says_its_name():
    part = play.slider("sigma", (0.1, 0.2, 0.3))
    assert isinstance(part, ipywidgets.SelectionSlider)
    assert part.description == "sigma" and [name for name, _ in part.options] == [
        "0.1",
        "0.2",
        "0.3",
    ]


def test_sliders_and_strips_are_laid_out_as_they_were():
    """The middle of an even number of values is the upper; 30 rem wide; four settings a strip."""
    part = play.slider("a", (1, 2.5, 1e-7, 4))
    assert part.value == 1e-7 and [name for name, _ in part.options] == ["1", "2.5", "1e-07", "4"]
    assert (part.layout.width, part.layout.max_width) == ("30rem", "100%")
    assert play.spread_settings({"a": range(11)}) == [{"a": a} for a in (0, 3, 7, 10)]
    assert play.spread_settings({"a": range(11)}, 3) == [{"a": a} for a in (0, 5, 10)]
    with pytest.raises(ValueError) as told:
        play.spread_settings({})
    assert str(told.value) == "0 sliders: say by `shown` which settings the strip has."
    assert play.said({"x": 0.1, "y": 2.0}) == "x 0.1, y 2"
    sliders = Sliders(noted([]), {"a": (1, 2), "b": (3, 4)}, [{"a": 1, "b": 3}])
    figure = sliders.figure([{"a": 1, "b": 3}] * 3, larger=2.0)
    assert figure.get_size_inches().tolist() == pytest.approx([3 * 2 * 3.1, 2 * 3.1])
    assert len(figure.axes) == 3 and play.SIDE == 3.1
    names = [child.description for child in sliders.widget.children[:2]]
    assert names == ["a", "b"] and sliders.widget.children[2] is sliders.image


def test_a_drawing_gets_its_own_axis_and_settings():
    seen = []
    sliders = Sliders(lambda axis, **of: seen.append((axis, of)), {"a": (1, 2, 3)})
    figure = sliders.figure([{"a": 1}, {"a": 3}])
    assert seen[1:] == [(figure.axes[0], {"a": 1}), (figure.axes[1], {"a": 3})]
    assert seen[0][1] == {"a": 2}


def test_curves_are_drawn_as_they_were():
    """Dots of 4 points on a line of 1.2, colours in an order of their own, the legend below."""
    curves = Curves("step", "return", every=np.inf)
    for k, name in enumerate("abcdefg"):
        curves.add(name, k, 2 * k)
        curves.add(name, k + 1, 2 * k + 1)
    figure = curves.figure()
    (axis,) = figure.axes
    assert figure.get_size_inches().tolist() == [6.4, 3]
    order = (1, 4, 2, 3, 0, 5, 1)
    for k, (line, colour) in enumerate(zip(axis.lines, order, strict=True)):
        assert line.get_color() == play.COLOURS[colour]
        assert line.get_xydata().tolist() == [[k, 2 * k], [k + 1, 2 * k + 1]]
        style = line.get_marker(), line.get_linestyle(), line.get_markersize(), line.get_linewidth()
        assert style == (".", "-", 4, 1.2)
    assert axis.get_legend()._get_loc() == 4  # lower right


def test_a_curve_is_shown_when_more_time_than_asked_has_gone(monkeypatch):
    """The first point at once, a second one after just two seconds not yet."""
    now, shown, handles = [50.0], [], []
    monkeypatch.setattr(play.time, "monotonic", lambda: now[0])
    handle = SimpleNamespace(update=lambda figure: shown.append("again"))
    monkeypatch.setattr(
        play, "display", lambda *_, **of: handles.append(of) or shown.append("new") or handle
    )
    curves = Curves("x", "y")
    assert curves.every == 2.0
    for now[0] in (50.0, 52.0, 52.1, 53.0):
        curves.add("a", 0, 0)
    assert shown == ["new", "again"] and handles == [{"display_id": True}]


def test_what_an_episode_earned_is_told_from_its_own_beginning():
    """A reset in the middle of an episode starts its sum and its place anew; options go on."""

    class Env(gym.Env):
        def reset(self, **options):
            asked.append(options)
            return 0, {}

        def step(self, action):
            return 0, action, action == 3, False, {}

    told, asked = [], []
    env = Told(Env(), lambda *what: told.append(what), 4)
    for actions in ((1, 2), (1, 3), (3,), (3,)):
        env.reset(seed=len(actions))
        for action in actions:
            env.step(action)
    # the third episode begins with the fifth step, and four are those of the training
    assert told == [(4, 4.0)] and env.steps == 6 and env.earned == 3.0
    assert asked == [{"seed": n} for n in (2, 2, 1, 1)]
