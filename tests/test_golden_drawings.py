"""Drawings are what the shipped eyes learned from: their chances, shapes and pictures."""

import numpy as np
import pytest

from lbw_minimal.clips import drawings, drawn_camera
from lbw_minimal.clips import drawn_shapes as draw
from tests.toy_chance import Told, cells

# A rounding of a grey level in some pixels is no change; a mean of hundreds of them moves less.
PIXELS = {"rtol": 5e-4, "atol": 0.05}


def brief(draws, clip):
    """How many draws it took, and what became of them."""
    places = np.concatenate([clip.tip, clip.object])
    seen = np.nan_to_num(places, nan=-1).mean(0)
    return [len(draws), *seen, clip.frames.mean(), clip.frames.std(), *clip.masks.mean((0, 1, 2))]


@pytest.mark.parametrize("kind", drawings.STORIES)
def test_a_story_is_drawn_as_it_was(kind, golden):
    """One in full, and nine in brief: most of what is drawn by chance is so met both ways."""
    rng = Told(0)
    clip = drawings.draw_clip(rng, 5, kind)
    figures = {
        "draws": rng.draws[:0] if kind in ("alone", "nothing") else rng.draws,
        "tip": clip.tip,
        "object": clip.object,
        "last frame": cells(clip.frames[-1].mean(2), 4),
        "colours": clip.frames.mean((1, 2)),
        "masks": cells(clip.masks.mean(0), 4),
    }
    for seed in range(1, 10):
        rng = Told(seed)
        clip = drawings.draw_clip(rng, 4 + seed % 3, kind)
        figures[f"in brief {seed}"] = brief(rng.draws, clip)
    golden(figures, **PIXELS)


def test_kinds_are_drawn_by_their_shares_and_clips_have_twelve_frames(golden):
    rng = Told(5)
    clip = drawings.draw_clip(rng)
    golden({"draws": rng.draws[:16], "shape": clip.frames.shape, "brief": brief(rng.draws, clip)},
           **PIXELS)  # fmt: skip


def test_phases_of_a_motion_are_as_long_as_they_were(golden):
    """Fifteen motions in seven moments, and all that was drawn for four of them."""
    time, figures = np.linspace(0, 1, 7)[:, None], {}
    for seed in range(15):
        rng = Told(seed)
        begins, *steps = drawings.phases(rng, time)
        figures[f"when {seed}"] = [begins, *np.concatenate(steps).ravel()]
        if seed < 4:
            figures[f"draws {seed}"] = rng.draws
    golden(figures)


def a_story(kind, seed=3):
    story = drawings._story(np.random.default_rng(seed), kind, 4)
    return story._replace(half=np.array([9.0, 6.0]), closed=np.array([50.0, 44.0]),
                          object=np.array([[24.0, 40], [30, 42], [40, 44], [48, 45]]))  # fmt: skip


@pytest.mark.parametrize("kind", ["push", "drawer"])
def test_things_rooms_and_bystanders_are_drawn_as_they_were(kind, golden):
    figures, ground, story = {}, np.array([90.0, 60, 30]), a_story(kind)
    for seed in range(4):
        for name, make in (
            ("object", lambda rng: drawings._object(rng, story, ground)(3)),
            ("bystander", lambda rng: drawings.a_bystander(rng, 5)(2)),
            ("cabinet", lambda rng: drawings._cabinet(rng, story, ground)),
            ("mark", lambda rng: drawings.a_mark(rng, story)),
            ("room", lambda rng: drawings.a_room(rng, story)[0]),
        ):
            rng = Told([seed, ord(name[0])])
            picture = make(rng).astype(float)
            figures[f"{name} {seed}"] = [len(rng.draws), *cells(picture[..., -1], 4),
                                         *picture.mean((0, 1))]  # fmt: skip
    golden(figures, **PIXELS)


def test_clutter_and_shadows_are_drawn_as_they_were(golden):
    rng, layer = Told(1), draw.empty()
    drawings._clutter(rng, layer, 9, (0, 10), (84, 60))
    dark = drawings._lit(layer, 0.4, (7, -3), 2.5)
    golden(
        {"draws": rng.draws, "layer": cells(layer, 4), "dark": cells(255 * dark[..., 0])}, **PIXELS
    )


# Shapes


BODY, ON_IT = np.array([200.0, 120, 60]), np.array([30.0, 90, 220])


@pytest.mark.parametrize("kind", [*draw.THINGS, "front"])
def test_a_thing_has_its_parts_where_they_were(kind, golden):
    """Large, turned, wider than high, and not in the middle."""
    layer = draw.empty()
    at, half = np.array([38.0, 45]), np.array([26.0, 20])
    draw.thing(layer, kind, at, half, (BODY, ON_IT), 0.3)
    small = draw.empty()
    draw.thing(small, kind, at, half / 4, (BODY, ON_IT))
    golden({"turned": cells(layer, 4), "small": small.mean((0, 1)) * 10}, **PIXELS)


def person(hand, seed=0):
    """A person with all that people can have."""
    one = draw.Person(np.random.default_rng(seed), 55.0)
    one.hand, one.length, one.flip, one.down, one.seen = draw.HANDS[hand], 30.0, -1, False, 0.8
    one.bend, one.sway, one.skin, one.glove = 0.2, 0.3, BODY, ON_IT
    one.cloth, one.second, one.watch = np.array([40.0, 160, 80]), np.array([220.0, 220, 20]), ON_IT
    one.wrist, one.elbow, one.sleeve, one.loose, one.stripes = 5.0, 8.0, 0.4, 1.3, 3
    one.elbow_side, one.bones, one.light = 1, np.array([36.0, 34]), np.array([0.3, -0.2])
    one.torso, one.tool, one.tool_radius, one.tool_turn = np.array([10.0, 20]), 0.0, 2.5, 0.4
    one.tool_colour, one.knit = np.array([250.0, 20, 200]), np.ones((84, 84, 1), np.float32)
    one.knit[20:50, 10:40] = 0.7
    return one


@pytest.mark.parametrize("hand", draw.HANDS)
def test_an_arm_has_its_hand_sleeve_watch_and_torso_where_they_were(hand, golden):
    one = person(hand)
    bare = one.draw(np.array([62.0, 50]), np.array([12.0, 38]), 0.4)
    one.down, one.flip, one.tool, one.sleeve, one.torso, one.watch = True, 1, 14.0, -1.0, None, None
    one.elbow_side = -1
    tool = one.draw(np.array([50.0, 66]), np.array([14.0, 20]), 0.9)
    golden({"sleeve": cells(bare, 4), "tool": cells(tool, 4)}, **PIXELS)


def test_people_are_made_as_they_were(golden):
    """Ten by their numbers, and all that was drawn for three of them."""
    figures = {}
    for seed in range(10):
        rng = Told(seed)
        one = draw.Person(rng, 40.0)
        figures[f"person {seed}"] = [
            one.length, one.flip, one.down, one.seen, one.bend, one.sway, *one.skin, *one.cloth,
            *one.glove, one.wrist, one.elbow, one.sleeve, one.loose, one.knit.mean(),
            one.knit.std(), one.stripes, *one.second, one.watch is None, one.elbow_side,
            *one.bones, one.torso is None, *one.light, one.tool, one.tool_radius, one.tool_turn,
        ]  # fmt: skip
        if seed < 3:
            figures[f"draws {seed}"] = rng.draws
    golden(figures)


def test_colours_and_surfaces_are_drawn_as_they_were(golden):
    figures = {}
    for seed in range(6):
        rng = Told(seed)
        made = [draw.a_colour(rng), draw.a_colour(rng, BODY), draw.a_skin(rng)]
        pattern = draw.a_surface(rng, 0.2)
        figures[f"colours {seed}"] = np.concatenate(made)
        figures[f"surface {seed}"] = [pattern.std(), *cells(255 * pattern[..., 0], 4)]
        figures[f"draws {seed}"] = rng.draws
    golden(figures)


def test_layers_are_laid_smeared_and_drawn_to_a_sixteenth_of_a_pixel(golden):
    layer = draw.empty()
    draw.polygon(layer, np.array([[10.3, 12.2], [60.7, 20.4], [40.1, 70.9]]), BODY, 180)
    draw.stick(layer, np.array([20.2, 60]), np.array([70, 30.6]), 2.3, 5.7, ON_IT)
    smear = draw.smeared(layer, np.array([5.3, -2.4]))
    picture = draw.over(np.full((84, 84, 3), 50, np.float32), layer)
    turned = draw.turned(np.array([2.0, 5]), 0.7)
    golden({"layer": cells(layer, 4), "smear": cells(smear, 4), "over": cells(picture, 4),
            "turned": turned}, **PIXELS)  # fmt: skip


# The camera


def filmed(seed):
    """A lopsided picture and its masks, filmed: what the camera drew, and what came of it."""
    y, x = np.mgrid[:84, :84].astype(np.float32)
    pictures = [np.stack([2 * x + t, 3 * y, x + y], 2) for t in range(5)]
    masks = [np.stack([255.0 * (x > 40 + t), 3 * y], 2).astype(np.uint8) for t in range(5)]
    places = np.array([[[30.0 + t, 25] for t in range(5)], [[50.0 - t, 60] for t in range(5)]])
    rng = Told(seed)
    return rng.draws, drawn_camera.filmed(rng, pictures, masks, places)


def test_cameras_film_as_they_did(golden):
    """Sixteen cameras, of which four in full."""
    figures = {}
    for seed in range(16):
        draws, (frames, tip, thing, cells_) = filmed(seed)
        places = np.nan_to_num([tip[[0, -1]], thing[[0, -1]]], nan=-1).ravel()
        figures[f"film {seed}"] = [len(draws), *places, *frames[1].mean((0, 1)), frames.std(),
                                   *cells_[3].mean((0, 1))]  # fmt: skip
        if seed < 4:
            figures[f"draws {seed}"] = draws
            figures[f"picture {seed}"] = cells(frames[1].mean(2), 4)
    golden(figures, **PIXELS)
