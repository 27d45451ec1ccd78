"""A command that is asked for none of what it counts, or for what does nothing, says so at once."""

import pytest

from tasks.__main__ import main

COUNTS = [
    *(("controls push", "--episodes"), ("robustness push", "--episodes"), ("push", "--episodes")),
    *(("table", "--episodes"), ("table", "--jobs"), ("table", "--seeds"), ("push", "--videos")),
    *(("paper", "--episodes"), ("paper", "--jobs"), ("paper", "--seeds"), ("push", "--threads")),
]


@pytest.mark.parametrize(("command", "option"), COUNTS)
def test_none_is_refused(command, option, capsys):
    assert main([*command.split(), option, "0"]) == 2
    assert f"{option}: '0'" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["controls push", "robustness push", "probe push", "eyes"])
def test_no_seed_is_below_0(command, capsys):
    assert main([*command.split(), "--seed", "-1"]) == 2
    assert "--seed: '-1'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "quoted"),
    [
        ("push --method tracks --from-scratch", "--from-scratch does"),
        ("push --from-scratch --weights elsewhere", "--weights elsewhere does"),
        ("push --evaluate --set updates=3 --set entropy=-2", "--set updates=3, entropy=-2 does"),
    ],
)
def test_what_does_nothing_is_quoted_as_it_was_typed(line, quoted, capsys):
    assert main(line.split()) == 2
    assert f"error: {quoted} nothing here: " in capsys.readouterr().err
