"""Reports say what is so: nothing of the check's own doing is laid to the student."""

import time
import warnings

import numpy as np
import pytest

from tests.grade import check
from tests.grade import notebook as in_notebook
from tests.grade.exercise import different, everything, find
from tests.grade.judge import judge
from tests.test_examples import failed


def told(id, source):
    """The sentences to an answer that runs in this process."""
    run = find(id).run(source)
    return {o.message for o in judge(find(id), lambda args: (run(args), False)).outcomes}


@pytest.mark.parametrize("value", ["None", "(0.5, 0.5)"])
@pytest.mark.parametrize("exercise", everything().values(), ids=list(everything()))
def test_what_the_check_cannot_use_is_no_error_of_the_students(exercise, value):
    if exercise.source.startswith("def ") and exercise.id != "3.2":  # there two bodies are missed
        said = told(exercise.id, f"def {exercise.name}(*args):\n    return {value}\n")
        assert not [s for s in said if "raises" in s and "stack it" not in s], said


def test_what_a_gradient_is_of_is_said():
    """2.4's call to paste returns the loss, which is right."""
    text = failed(find("2.4"), find("2.4").source.replace(".detach()", ""))
    assert "\n# the gradient for log_pi: it gives" in text


def test_images_that_are_still_tied_are_said_to_be_right():
    text = failed(find("11.2"), find("11.2").source.replace("made.detach()", "made"))
    assert text.endswith("item 0: it returns True; expected False")


def test_images_that_are_not_stacked_are_told_so():
    said = told("11.2", find("11.2").source.replace("torch.stack(shown)", "shown"))
    assert said == {"it raises ValueError: what is shown is a list: stack it to one tensor"}


@pytest.mark.parametrize("made", ["reset", "the class"])
def test_an_observation_that_changes_later_is_told_so(made):
    """Its start was right when it was returned."""
    new = "self.seen = np.zeros(1, np.float32); " if made == "reset" else ""
    source = find("1.5").source.replace(
        "        return np.array([self.x], np.float32), {}",
        f"        {new}self.seen[0] = self.x\n        return self.seen, {{}}",
    ).replace("observation = np.array([self.x], np.float32)",
              "self.seen[0] = self.x; observation = self.seen")  # fmt: skip
    source = source.replace(":\n", ":\n    seen = np.zeros(1, np.float32)\n", 1)
    said = told("1.5", source)
    assert len(said) == 1 and "changes after it was returned" in said.pop()


def test_where_it_is_furthest_off_is_shown_and_what_is_left_of_nothing_is_0():
    check = find("0.1").checks[0]
    said = different(np.array([1.01, 3.0]), np.array([1.0, -2e-16]), check)
    assert said == "it gives 3 at (1,); expected 0"


def test_the_checks_own_attempts_warn_of_nothing():
    """A known mistake of 8.3 divides by 0 where all the motion is inside, as it is asked there."""
    source = find("8.3").source.replace("    return", "    if mask.all(): return 2.0\n    return")
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        told("8.3", source)
    assert not found


def test_an_answer_without_end_is_stopped_once(monkeypatch, capsys):
    monkeypatch.setattr(in_notebook, "WALL", 1)
    space = {"check": check}
    exec("import numpy as np\ndef r1(z, z_E):\n    while True:\n        pass", space)
    start = time.monotonic()
    exec("check('6.1')", space)
    assert time.monotonic() - start < 2.5
    assert capsys.readouterr().out.count("no answer within 1 s") == 1


def test_an_id_needs_no_quotes_and_a_wrong_one_gets_one_line(capsys):
    space = {"check": check}
    exec(f"import numpy as np\n{find('6.1').source}\ncheck(6.1)", space)
    assert "4 of 4" in capsys.readouterr().out
    with pytest.raises(in_notebook.StillOpen, match=r"no exercise '6\.9'; there are 0\.1") as stop:
        exec("check('6.9')", space)
    assert len(stop.value._render_traceback_()) == 1


def test_the_number_under_a_report_says_whom_it_is_for():
    points = in_notebook.Points(4)
    assert repr(points) == "4"  # nbgrader reads it
    assert "gradebook: 4" in points._repr_html_()
