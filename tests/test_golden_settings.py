"""Settings and recipes are those of the shipped results."""

import ast
import dataclasses
import importlib
import inspect
import json
from types import SimpleNamespace

import numpy as np
import pytest

import tasks
from lbw_minimal.imitate import Recipe
from lbw_minimal.training import InputError
from tasks.commands import eyes, prepare, probe, recipe, run

MODULES = {
    "lbw_minimal.clips": (
        *("detector", "detector_networks", "drawings", "drawn_shapes", "patches", "corners"),
        *("reader", "decoding", "hdr", "upright", "footage", "stills", "lookalike", "camera"),
        *("motion", "outline", "hiding", "paths", "pushing", "retarget", "screen", "shots", "arms"),
        *("light", "vanished", "behind", "lifting", "used"),
    ),
    "tasks": tuple(tasks.TASKS),
    "tasks.world": ("arm", "bodies", "env", "motion", "reenact", "scene", "windows"),
    "tasks.commands": (
        *("eyes", "prepare", "run", "recipe", "probe", "ablation", "batch", "controls", "paper"),
        *("robustness", "table", "translations", "stage", "choices"),
    ),
}


def flat(value):
    """A setting as JSON has it; None for what is none, a class, say."""
    if isinstance(value, np.ndarray):
        return None if value.size > 40 else flat(value.tolist())
    if isinstance(value, dict):
        return {str(key): flat(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [flat(one) for one in value]
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, str) and len(value) > 80:
        return None  # a text, which may be said better
    return value if isinstance(value, str | int) else None


DRAWN = {"HANDS", "SKINS", "ROUND", "SQUARE", "STORIES", "PHASES", "TO_BT709", "PLACE"}
# What depends on the machine, and where the kit lies.
ELSEWHERE = {"THREADS", "EYES", "MARKS", "PYAV", "ODD_TEXT"}


def settings(module):
    """The constants that a module defines itself, and its functions' defaults.

    Not those that each drawing shows.
    """
    out = {}
    for line in ast.parse(inspect.getsource(module)).body:
        if isinstance(line, ast.Assign | ast.AnnAssign):
            targets = line.targets if isinstance(line, ast.Assign) else [line.target]
            names = {one.id for target in targets for one in ast.walk(target)
                     if isinstance(one, ast.Name)}  # fmt: skip
            out |= {name: flat(getattr(module, name)) for name in sorted(names - DRAWN - ELSEWHERE)}
        elif isinstance(line, ast.FunctionDef):
            for p in inspect.signature(getattr(module, line.name)).parameters.values():
                if isinstance(p.default, int | float | str):
                    out[f"{line.name}({p.name})"] = flat(p.default)
    return {name: json.dumps(value) for name, value in out.items() if value is not None}


@pytest.mark.parametrize("package", MODULES)
def test_settings_are_those_of_the_shipped_results(package, golden):
    """A number that means something has a name, so this is a list of nearly all of them."""
    figures = {}
    for name in MODULES[package]:
        found = settings(importlib.import_module(f"{package}.{name}"))
        figures |= {f"{name}.{key}": value for key, value in found.items()}
    golden(figures)


def test_what_nobody_asks_for_is_what_was_shipped(golden):
    figures = {}
    for name, parser, line in (
        ("eyes", eyes.parser, []), ("probe", probe.parser, ["push"]),
        ("prepare", prepare.parser, ["push", "a.mp4"]), ("run", lambda: run.parser("push"), []),
    ):  # fmt: skip
        given = vars(parser().read(line))
        given.pop("device", None)
        figures |= {f"{name} {k}": str(v).replace(str(tasks.ROOT), "") for k, v in given.items()}
    golden({name: value.replace("\\", "/") for name, value in figures.items()})


METHODS = ("lbw", "avid", "classifier", "tracks")


# Of every field another value, and fewer steps than smoke runs take.
RECIPE = Recipe(
    human_frames=901, robot_frames=902, munit_iterations=903, munit_width=904, K=17,
    transporter_iterations=905, policy_steps=4906, updates=19, entropy=-3.5, shift=3, hue=7,
    motion=True, classifier_iterations=907, random_negatives=False, clip=9.5, pixel_updates=23,
    hold=29,
)  # fmt: skip


def test_tasks_are_learnt_by_the_recipes_that_they_had(golden):
    golden({name: str(importlib.import_module(f"tasks.{name}").RECIPE) for name in tasks.TASKS})


def test_a_method_takes_of_a_recipe_what_it_took(golden):
    """In full, in smoke sizes, on a clip, and with what `--set` says."""
    figures = {}

    def asked(method, own=RECIPE, **more):
        given = {"method": method, "fast": False, "video": None, "translate_clip": False,
                 "weights": None, "set": []}  # fmt: skip
        made = recipe.recipe_of(own, SimpleNamespace(**given | more), True)
        fields = recipe.fields_of(made, method)
        return list(fields), list(fields.values())

    for method in METHODS:
        for how, more in (
            ("full", {}), ("fast", {"fast": True}), ("clip", {"video": "a"}),
            ("translated", {"video": "a", "translate_clip": True}),
            ("set", {"set": ["policy_steps=77", "entropy=0.25"]}),
        ):  # fmt: skip
            names, figures[f"{method} {how}"] = asked(method, **more)
        figures[f"{method} fields"] = names
    for steps in (5100, 10100):
        own = dataclasses.replace(RECIPE, policy_steps=steps)
        figures[f"{steps} steps"] = asked("tracks", own)[1] + asked("lbw", own, video="a")[1]
    golden(figures)


def test_settings_that_are_refused_are_refused_as_they_were(golden):
    said = {}
    for method, weights, scratch, text in (
        ("lbw", None, False, "K=3"), ("lbw", None, True, "hold=3"), ("lbw", None, True, "K=0"),
        ("lbw", None, True, "K=1.5"), ("lbw", None, True, "shift=x"), ("lbw", None, True, "hue="),
        ("avid", "w", True, "motion=3"), ("avid", None, True, "human_frames=3"),
        ("lbw", None, True, "K"),
        ("classifier", None, True, "random_negatives=2"), ("classifier", None, True, "clip=inf"),
        ("tracks", None, True, "K=3"),
    ):  # fmt: skip
        args = SimpleNamespace(method=method, weights=weights, set=[text])
        try:
            said[f"{method} {text}"] = str(recipe.read_settings(args, scratch))
        except InputError as error:
            said[f"{method} {text}"] = str(error)
    args = SimpleNamespace(method="classifier", weights=None,
                           set=["random_negatives=1", "clip=2e1", "hold=4", "hold=5"])  # fmt: skip
    said["taken"] = str(recipe.read_settings(args, True))
    golden(said)
