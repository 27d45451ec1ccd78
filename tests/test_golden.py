"""Golden figures notice what differs, and only that."""

import numpy as np
import pytest
import torch

from tests import golden

KEPT = {"loss": [0.5, 2.0], "steps": [3.0], "name": "push"}


def test_figures_within_the_tolerance_are_the_same():
    golden.compare(KEPT, KEPT | {"loss": [0.5004, 2.0]}, rtol=1e-3, atol=0)


@pytest.mark.parametrize(
    "other",
    [
        {"loss": [0.501, 2.0]},
        {"loss": [0.5]},
        {"loss": [0.5, float("nan")]},
        {"name": "slide"},
        {"new": [1.0]},
    ],
    ids=["one-off", "one-less", "no-number", "another-word", "one-more"],
)
def test_any_other_figures_are_noticed(other):
    with pytest.raises(AssertionError):
        golden.compare(KEPT, KEPT | other, rtol=1e-3, atol=0)


def test_a_figure_less_is_noticed():
    with pytest.raises(AssertionError):
        golden.compare(KEPT, {"loss": [0.5, 2.0]}, rtol=1e-3, atol=0)


def test_numbers_come_from_arrays_and_tensors_row_by_row():
    assert golden.rounded(torch.tensor([[1.0, 2.0], [3.0, 4.0]])) == [1, 2, 3, 4]
    assert golden.rounded(np.float32(1 / 3)) == [0.333333]
    assert golden.rounded(np.arange(2, dtype=np.uint8)) == [0, 1]


def test_words_and_truths_stay_what_they_are():
    assert golden.rounded(["a", "b"]) == ["a", "b"]
    assert golden.rounded(True) is True
    assert golden.rounded(None) is None


def test_what_was_written_is_what_is_compared(tmp_path, monkeypatch):
    monkeypatch.setattr(golden, "FOLDER", tmp_path)
    ask = ("tests/test_sac.py::test_step[two-3]", {"loss": torch.tensor([0.25, -1e-9])}, 1e-3, 0)
    with pytest.raises(AssertionError, match="--write-golden"):
        golden.check(*ask, write=False)
    golden.check(*ask, write=True)
    golden.check(*ask, write=False)
    assert (tmp_path / "test_sac" / "test_step_two_3.json").read_text() == (
        '{\n"loss": [0.25, -1e-09]\n}\n'
    )
    with pytest.raises(AssertionError, match="loss"):
        golden.check(ask[0], {"loss": [0.5, -1e-9]}, 1e-3, 0, write=False)


def test_every_file_of_golden_figures_belongs_to_a_test():
    """The figures of a test that is gone would be kept for ever."""
    for kept in golden.FOLDER.glob("*/*.json"):
        tests = (golden.FOLDER.parent / f"{kept.parent.name}.py").read_text()
        names = [line[4:].partition("(")[0] for line in tests.splitlines() if line[:4] == "def "]
        assert any(kept.stem == n or kept.stem.startswith(n + "_") for n in names), kept
