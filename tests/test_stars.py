"""The stars: each shines for the kit's solution and not for a first thought, and waits if open."""

import ast
import functools
import math
import re

import nbformat
import numpy as np
import pytest

from lbw_minimal.imitate import Perception
from solutions.__main__ import NOTEBOOKS, sources
from tests.grade import star
from tests.grade.exercise import everything
from tests.grade.star import Star, find
from tests.grade.stars import nb04
from tests.grade.submission import answer, read

# What one thinks of first, as the text of its notebook says it.
FIRST = {
    0: """
def blind(t):
    return (0, 0, -1) if t < 8 else (0.25, 0, 0)
""",
    6: """
def patient(z_E):
    t = 0

    def pay(z, z_next):
        nonlocal t
        t += 1
        return -np.linalg.norm(z_next - z_E[min(t, len(z_E) - 1)])

    return pay
""",
    7: """
def again(target, tries):
    v, d = tries[-1] if tries else (1.0, 1 / (2 * 0.14 * 9.81))
    return v * (target / d) ** 0.5
""",
    1: """
def spare(q, dq, M, J, gap, drift):
    return -3 * J.T @ gap / max(np.linalg.norm(gap), 0.02) ** 2 - 6 * M @ dq
""",
    2: """
def temperature(share, entropy):
    return 0
""",
    3: """
from tasks.world import random_actions


def wander(rng):
    return random_actions(rng)
""",
    4: """
def doubt(human, there, back):
    again = back(there(human)).astype(float)
    return np.abs(again - human).mean((1, 2, 3))
""",
    5: """
def hold(maps):
    return transporter.soft_argmax(torch.from_numpy(maps)[None])[0].numpy()
""",
    8: """
import cv2


def put_out(film):
    film, median = film.astype(float), np.median(film, axis=0)
    for frame in film:
        off = np.uint8(np.abs(frame - median).mean(-1) > 8)
        _, part, sizes, _ = cv2.connectedComponentsWithStats(off)
        small = (sizes[:, -1] < 60)[part]
        frame[small] = median[small]
    return film
""",
    9: """
def steer(z, actions, z_E):
    J = np.linalg.lstsq(actions, np.diff(z, axis=0).reshape(len(actions), -1), rcond=None)[0].T
    back = np.linalg.pinv(J)
    return lambda z, t: np.clip(back @ (z_E[t + 1] - z).ravel(), -1, 1)
""",
    10: """
def sees(play):
    won = [sum(play(camera, 1.0) for _ in range(15)) for camera in ("open", "grey")]
    return won[0] - won[1] > 4
""",
    11: """
def trick(t):
    return (1, 0, -0.33) if t < 6 else (0, 0, 0)
""",
    12: """
def mend(times, found):
    wide = np.pad(found, ((2, 2), (0, 0)), mode="edge")
    return np.median([wide[i : i + len(found)] for i in range(5)], axis=0)
""",
    13: """
def locate(frames, points):
    paths, _ = tracks.follow(frames, points)
    return np.median(paths - points, axis=1)
""",
}
by_star = pytest.mark.parametrize("number", FIRST)
# Films are translated, keypoints fitted and episodes played for three of them.
by_measured_star = pytest.mark.parametrize(
    "number", [pytest.param(n, marks=pytest.mark.slow) if n in (4, 5, 9) else n for n in FIRST]
)


def once(translate):
    """The translation, which works out no film twice."""
    done = {}

    def translated(*asked):
        key = tuple(a.tobytes() if isinstance(a, np.ndarray) else id(a) for a in asked)
        if key not in done:
            done[key] = asked, translate(*asked)  # what lives keeps its id
        return done[key][1].copy()

    return translated


@pytest.fixture(scope="module", autouse=True)
def films_are_translated_once():
    """Star 4 has the same ones translated for its measure, the kit's answer and the first thought,
    in 1 s each."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Perception, "translate", once(Perception.translate))
        patch.setattr(nb04, "back_to_human", once(nb04.back_to_human))
        yield


@functools.cache
def cells(number, folder=None):
    """The star's text, its cell and the cell that measures it."""
    path = sources()[number]
    book = nbformat.read((folder or path.parent) / path.name, 4).cells
    ids = [c.metadata.get("nbgrader", {}).get("grade_id") for c in book]
    i = ids.index(f"star-{number}")
    return [c.source for c in book[i - 1 : i + 2]]


def defined(number, source):
    """The answer that a cell defines, with what its notebook imports at the top."""
    exec(nbformat.read(sources()[number], 4).cells[1].source, space := {})
    exec(source, space)
    return space[re.fullmatch(rf"star\({number}, (\w+)\)", cells(number)[2])[1]]


def test_every_star_of_a_notebook_is_tried_here():
    marked = {p.stem[:2] for p in sources() if "# Star " in p.read_text(encoding="utf-8")}
    assert marked == {f"{number:02}" for number in FIRST}


@by_measured_star
def test_the_kits_solution_shines_and_reaches_what_is_said(number):
    found = find(number)
    reached = found.measure(defined(number, cells(number)[1]))
    assert found.shines(reached)
    assert reached == pytest.approx(found.ours, rel=0.02)


@by_measured_star
def test_a_first_thought_does_not_shine_and_reaches_what_is_said(number):
    found = find(number)
    reached = found.measure(defined(number, FIRST[number]))
    assert not found.shines(reached)
    assert reached == pytest.approx(found.naive, rel=0.02)


@by_star
def test_the_text_says_what_is_known(number):
    found, text = find(number), cells(number)[0]
    for value in (found.bar, found.naive, found.ours):
        assert re.search(rf"(?<![\d.]){re.escape(f'{value:g}')}(?![\d]|\.\d)", text), value
    assert "worth no points" in text


@by_star
def test_an_open_star_lets_the_notebook_go_on(number, capsys):
    _, stub, measured = cells(number, NOTEBOOKS)
    exec(f"{stub}\n{measured}", {"star": star})
    assert capsys.readouterr().out.startswith(f"Star {number} is open.")


@by_star
def test_a_star_answers_no_exercise(number):
    """Nor do its names, by which the grader looks for answers whose marks are gone; and they
    take the place of nothing that the notebook has made."""
    book = read(NOTEBOOKS / sources()[number].name)
    (cell,) = [c for c in book.cells if c.source.startswith(f"# Star {number}\n")]
    assert not cell.exercise
    taken = {e.name for e in everything().values()}.union(*(c.defines for c in book.cells))
    assert not taken & {n.name for n in ast.parse(cells(number)[1]).body}


def test_an_answered_star_leaves_open_exercises_open():
    path = NOTEBOOKS / sources()[0].name
    book = read(path)
    for cell in book.cells:
        if cell.source.startswith("# Star 0\n"):
            cell.source, cell.course = FIRST[0], False
    assert all(answer(everything()[id], [book]).open for id in ("0.1", "0.2"))


@pytest.mark.parametrize(
    ("naive", "reached", "shines"),
    [(0.5, 0.9, True), (0.5, 0.89, False), (1.5, 0.9, True), (1.5, 0.91, False)]
    + [(0.5, math.nan, False), (1.5, math.nan, False)],
)
def test_from_the_bar_on_it_shines_on_the_side_away_from_the_naive(naive, reached, shines):
    assert Star(None, "", bar=0.9, naive=naive, ours=0.9).shines(reached) is shines


def test_what_an_answer_raises_is_shown():
    def blind(t):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        star(0, blind)


def test_a_notebook_without_a_star_is_named():
    with pytest.raises(ValueError, match="notebook 99 has no star"):
        star(99, print)
