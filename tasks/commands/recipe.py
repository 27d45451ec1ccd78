"""A run's recipe: its task's, in smoke sizes, for a person's clip, and with what `--set` says."""

from __future__ import annotations

import argparse
import dataclasses
import math
from typing import Any

from lbw_minimal.imitate import Recipe
from lbw_minimal.training import InputError

FAST = {
    "munit_iterations": 10,
    "munit_width": 8,
    "transporter_iterations": 20,
    "policy_steps": 800,
    "robot_frames": 200,
    "classifier_iterations": 200,
}
FAST_PIXELS = {"policy_steps": 530}  # few updates, each of which takes ten of LbW's
# Steps of a policy that follows a person's clip, whose way and pauses are another's: twice the
# task's, and at most so many unless the task itself has more.
CLIP_STEPS = 10_000
TRANSLATION = ("robot_frames", "munit_iterations", "munit_width")
PERCEPTION = (*TRANSLATION, "transporter_iterations", "K", "shift", "hue")
PIXELS = ("avid", "classifier")  # the rivals, who learn from pixels
# Fields that only they have.
RIVALS = ("classifier_iterations", "random_negatives", "clip", "pixel_updates", "hold")
METHODS = {  # and the fields of the recipe that each of them has
    "lbw": ("human_frames", *PERCEPTION, "policy_steps", "updates", "entropy"),
    "avid": ("human_frames", *TRANSLATION, "motion", *RIVALS, "policy_steps", "entropy"),
    "classifier": (*RIVALS, "policy_steps", "entropy"),
    "tracks": ("policy_steps", "updates", "entropy"),
}


def recipe_of(recipe: Recipe, args: argparse.Namespace, from_scratch: bool) -> Recipe:
    """The task's recipe as the arguments change it. Raises InputError, see `read_settings`."""
    if args.fast:
        fast: dict[str, Any] = FAST | FAST_PIXELS if args.method in PIXELS else FAST
        recipe = dataclasses.replace(recipe, **fast)
    elif args.video and args.method == "lbw" and not args.translate_clip:
        steps = max(recipe.policy_steps, min(2 * recipe.policy_steps, CLIP_STEPS))
        recipe = dataclasses.replace(recipe, policy_steps=steps)
    return dataclasses.replace(recipe, **read_settings(args, from_scratch))


def fields_of(recipe: Recipe, method: str) -> dict[str, Any]:
    """What the method takes of the recipe."""
    return {k: v for k, v in dataclasses.asdict(recipe).items() if k in METHODS[method]}


def read_settings(args: argparse.Namespace, from_scratch: bool) -> dict[str, Any]:
    """The recipe's fields that `--set NAME=VALUE` names, with values of the fields' types."""
    method = args.method
    fixed: tuple[str, ...] = ()  # fields of networks that are not trained here
    if method == "lbw" and not from_scratch:
        fixed, why = PERCEPTION, "perception is not trained here; add --from-scratch"
    elif method == "avid" and args.weights:
        fixed, why = (*TRANSLATION, "motion"), "the translation in --weights is not trained here"
    fields = {field.name: field for field in dataclasses.fields(Recipe)}
    fields = {name: fields[name] for name in fields_of(Recipe(0, 0), method)}
    fields.pop("human_frames", None)  # `record` films so many; here the videos have what they have
    out = {}
    for text in args.set:
        name, _, value = text.partition("=")
        if name not in fields:
            raise InputError(
                f"--set {text}: the recipe of --method {method} has no {name!r}; "
                f"it has {', '.join(fields)}."
            )
        if name in fixed:
            raise InputError(f"--set {text}: {why}.")
        out[name] = read_number(text, value, str(fields[name].type))
        if name == "clip" and out[name] <= 0:  # a logit is divided by it
            raise InputError(f"--set {text}: {value!r} is no number above 0.")
    return out


def read_number(text: str, value: str, kind: str) -> float:
    """The value of a setting whose type is called `kind`, as a number."""
    read, allowed, what = {
        "bool": (int, lambda number: number in (0, 1), "neither 0 nor 1"),
        "int": (int, lambda number: number >= 1, "no whole number of 1 or more"),
        "float": (float, math.isfinite, "no finite number"),
    }[kind]
    try:
        number = read(value)
    except ValueError:
        number = math.nan
    if not allowed(number):
        raise InputError(f"--set {text}: {value!r} is {what}.")
    return bool(number) if kind == "bool" else number
