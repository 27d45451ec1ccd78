"""Rendered clips: what is said of them is what they show."""

import numpy as np
import pytest

from lbw_minimal.clips import drawn_camera
from lbw_minimal.clips.drawings import FRAMES, STORIES
from lbw_minimal.clips.drawn_shapes import SIZE
from tasks.world import renderings
from tasks.world.renderings import render_clip


@pytest.fixture
def plain(monkeypatch):
    """A camera that changes nothing: pictures, masks and places as they were rendered."""

    def filmed(rng, pictures, masks, places):
        return np.stack(pictures), *places, np.stack(masks)

    monkeypatch.setattr(drawn_camera, "filmed", filmed)


def clips(kind, seeds=range(6)):
    return [render_clip(np.random.default_rng([5, seed]), kind=kind) for seed in seeds]


def inside(places):
    return ((places > 3) & (places < SIZE - 3)).all(1)


def test_a_clip_is_the_same_whenever_it_is_made():
    one, other, again = (render_clip(np.random.default_rng(i)) for i in (7, 8, 7))
    for a, b in zip(one, again, strict=True):
        assert np.array_equal(a, b, equal_nan=True)
    assert not np.array_equal(one.frames, other.frames)
    assert one.frames.shape == (FRAMES, SIZE, SIZE, 3) and one.frames.dtype == np.uint8
    assert one.masks.shape == (FRAMES, SIZE // 2, SIZE // 2, 2) and one.tip.shape == (FRAMES, 2)


@pytest.mark.parametrize("kind", STORIES)
def test_what_a_story_lacks_is_nowhere(kind, plain):
    for clip in clips(kind, range(3)):
        has_arm, moves = kind not in ("alone", "nothing"), kind not in ("reach", "nothing")
        assert np.isfinite(clip.tip).all() == has_arm and (clip.masks[..., 0].any() or not has_arm)
        assert clip.masks[..., 0].any() <= has_arm and clip.masks[..., 1].any() <= moves
        assert np.isfinite(clip.object).any() <= moves


def test_a_thing_is_where_its_mask_is(plain):
    """Its middle, where all of it is in the picture and nothing is before it."""
    for clip in clips("alone", range(12)):
        for at, mask in zip(clip.object, clip.masks[..., 1], strict=True):
            edge = mask[[0, -1]].any() or mask[:, [0, -1]].any()
            if edge or not mask.any() or not np.isfinite(at).all():
                continue
            y, x = np.nonzero(mask > 127)
            assert np.hypot(x.mean() + 0.5 - at[0], y.mean() + 0.5 - at[1]) < 6


def test_a_tip_is_at_its_arm(plain):
    """Of nine in ten frames: something may stand before it."""
    near = []
    for kind in ("push", "carry"):
        for clip in clips(kind):
            for at, mask in zip(clip.tip, clip.masks[..., 0], strict=True):
                if inside(at[None])[0]:
                    x, y = at.astype(int)
                    near.append(mask[max(0, y - 3) : y + 4, max(0, x - 3) : x + 4].any())
    assert np.mean(near) > 0.9 and len(near) > 60


def test_a_thing_behind_an_arm_is_nowhere(plain):
    """It is hidden in some clips, and seen in most."""
    share = [np.isfinite(clip.object[:, 0]).mean() for clip in clips("push", range(30))]
    assert 0 < np.mean(np.array(share) < 1) < 0.7


def test_a_clip_is_made_without_a_word(capfd):
    renderings._client.cache_clear()
    render_clip(np.random.default_rng(0), T=2)
    assert capfd.readouterr() == ("", "")
