"""Claims about the drawings, the detector that learns from them, and what it finds."""

import json

import cv2
import numpy as np
import pytest
import torch

from lbw_minimal import video
from lbw_minimal.clips import corners, detector, detector_networks, drawings, drawn_camera
from lbw_minimal.clips.detector import Detector, Found, refine
from lbw_minimal.clips.detector_networks import CELLS, Network, both_ways, loss, read, target
from lbw_minimal.clips.drawings import STORIES, Clip, draw_clip
from lbw_minimal.images import to_images
from lbw_minimal.training import Checkpoint, InputError
from tasks import VIDEOS, WEIGHTS, bare
from tasks.world import load_recordings

# Drawings


def disc(layer, at):
    drawings.draw.polygon(layer, at + 2 * drawings.ROUND, np.full(3, 255.0))
    return layer


@pytest.fixture
def black(monkeypatch):
    """Rooms are black and empty, cameras good: what a test draws is all there is to be seen."""
    monkeypatch.setattr(drawings, "a_colour", lambda *_: np.zeros(3))
    monkeypatch.setattr(drawings, "_clutter", lambda *_: None)
    monkeypatch.setattr(drawings, "a_bystander", lambda *_: lambda t: drawings.draw.empty())
    monkeypatch.setattr(drawn_camera, "_developed", lambda rng, f: f.clip(0, 255).astype(np.uint8))


def off(clip, place):
    """How far, in pixels, `place` is from what is bright, far from bars and edges."""
    y, x = np.mgrid[:84, :84] + 0.5
    for frame, at in zip(clip.frames[..., 0].astype(float), place, strict=True):
        if np.isfinite(at).all() and (np.abs(at - 42) < 16).all():
            near = frame * (np.hypot(x - at[0], y - at[1]) < 6)
            seen = np.array([(x * near).sum(), (y * near).sum()]) / near.sum()
            yield np.linalg.norm(seen - at)


def test_a_bright_tip_is_where_the_clip_says(black, monkeypatch):
    monkeypatch.setattr(drawings, "_object", lambda *_: lambda t: drawings.draw.empty())
    monkeypatch.setattr(
        drawings.draw.Person, "draw", lambda self, tip, *_: disc(drawings.draw.empty(), tip)
    )
    clips = [draw_clip(np.random.default_rng(i), 6, "reach") for i in range(60)]
    errors = [e for clip in clips for e in off(clip, clip.tip)]
    assert len(errors) > 40 and max(errors) < 0.2


def test_a_bright_object_is_where_the_clip_says(black, monkeypatch):
    monkeypatch.setattr(drawings.draw, "thing", lambda layer, kind, at, *_: disc(layer, at))
    clips = [draw_clip(np.random.default_rng(i), 6, "alone") for i in range(60)]
    errors = [e for clip in clips for e in off(clip, clip.object)]
    assert len(errors) > 40 and max(errors) < 0.2


@pytest.mark.parametrize("kind", STORIES)
def test_what_a_story_lacks_is_nowhere(kind):
    clips = [draw_clip(np.random.default_rng(i), kind=kind) for i in range(6)]
    tip, object_ = (np.isfinite([getattr(c, k) for c in clips]).any() for k in ("tip", "object"))
    assert tip == (kind not in ("alone", "nothing"))
    assert object_ == (kind not in ("reach", "nothing"))
    arm, thing = np.stack([c.masks for c in clips]).any(axis=(0, 1, 2, 3))
    assert (arm, thing) == (tip, object_)


def unfilmed(monkeypatch, limb):
    """Forty clips of drawers before a camera sees them, with `limb`, a layer, for all arms."""
    monkeypatch.setattr(drawings.draw.Person, "draw", lambda *_: limb)
    monkeypatch.setattr(drawings.draw, "smeared", lambda layer, way: layer)
    monkeypatch.setattr(drawn_camera, "filmed", lambda rng, p, m, places: (p, *places, m))
    return [draw_clip(np.random.default_rng(i), 6, "drawer") for i in range(40)]


def test_a_drawer_that_is_shut_is_still_there(monkeypatch):
    """It shows less than a fifth of what it showed when it was open; but nothing hides it."""
    clips = unfilmed(monkeypatch, drawings.draw.empty())
    shown = np.array([clip.masks[-1][..., 1].sum() / clip.masks[0][..., 1].sum() for clip in clips])
    assert shown.min() < 0.2
    assert all(np.isfinite(clip.object).all() for clip in clips)


def test_what_an_arm_hides_all_along_but_for_a_tenth_is_nowhere(monkeypatch):
    arm = drawings.draw.empty()
    arm[:, np.arange(84) % 10 > 0] = 255
    hidden = [np.isnan(clip.object).all() for clip in unfilmed(monkeypatch, arm)]
    assert 0.2 < np.mean(hidden) < 0.8  # half of the things are in front of the arm


def test_the_same_seed_draws_the_same_clip_and_another_seed_another():
    one, same, other = (draw_clip(np.random.default_rng(seed)) for seed in (4, 4, 5))
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(one, same, strict=True))
    assert not np.array_equal(one.frames, other.frames)


def test_a_table_below_the_picture_can_be_drawn():
    """Things on it would have to stand between 100 and 84: there are none, and no error."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        story = drawings._story(rng, "push", 6)._replace(object=np.full((6, 2), 112.0))
        assert drawings.a_room(rng, story)[0].shape == (84, 84, 3)


def test_a_smear_is_as_long_as_the_way_and_as_heavy_as_before():
    """A line of one column that goes 4 pixels to the right is 4 to 6 columns wide, not moved."""
    layer = drawings.draw.empty()
    layer[:, 40] = 200
    smeared = drawings.draw.smeared(layer, np.array([4.0, 0.0])).astype(float)
    row = smeared[42, :, 3]
    assert 4 <= (row > 0).sum() <= 6 and abs(row.sum() - 200) < 5
    assert abs((row * np.arange(84)).sum() / row.sum() - 40) < 0.05
    down = drawings.draw.smeared(layer, np.array([0.0, 4.0]))
    np.testing.assert_allclose(down.astype(int), layer.astype(int), atol=2)
    assert drawings.draw.smeared(layer, np.array([0.4, -0.9])) is layer


def test_stripes_are_on_the_sleeve_and_go_across_it():
    """A sleeve from left to right with two stripes: one a quarter along, one three quarters."""
    person = drawings.draw.Person(np.random.default_rng(0), 60)
    person.stripes, person.second = 2, np.full(3, 255.0)
    layer = drawings.draw.empty()
    person._striped(layer, np.array([20.0, 42.0]), np.array([60.0, 42.0]), 10, 5)
    columns, rows = (np.flatnonzero((layer[..., 3] > 128).any(axis)) for axis in (0, 1))
    assert columns[0] < 30 < columns[-1] and np.diff(columns).max() > 15
    left, right = (layer[:, c, 3] > 128 for c in (29, 49))
    assert left.sum() > right.sum() > 10  # it gets narrower towards the hand
    assert abs(rows.mean() - 41.5) < 1


def test_tips_are_at_the_arms_and_objects_in_their_masks():
    for seed in range(20):
        clip = draw_clip(np.random.default_rng(seed), kind="push")
        for place, mask, most in ((clip.tip, 0, 2.5), (clip.object, 1, 6)):
            for at, shown in zip(place, clip.masks[..., mask], strict=True):
                y, x = np.nonzero(shown > 40)
                if np.isfinite(at).all() and len(x):
                    assert np.hypot(2 * x + 1 - at[0], 2 * y + 1 - at[1]).min() < most


# What the map is taught, and how it is read


def test_target_is_a_distribution_and_nowhere_is_its_last_entry():
    places = torch.tensor([[[10.0, 70.0], [np.nan, np.nan]]])
    p = target(places)
    assert torch.allclose(p.sum(2), torch.ones(1, 2))
    row, column = divmod(p[0, 0, :-1].argmax().item(), CELLS)
    assert abs(2 * column + 1 - 10) <= 1 and abs(2 * row + 1 - 70) <= 1
    assert p[0, 0, -1] == 0 and p[0, 1, -1] == 1


def test_reading_what_is_taught_gives_the_place_back_to_a_twentieth_of_a_pixel():
    places = torch.tensor([[[10.3, 70.9], [41.0, 33.7]]])
    place, sure = read((target(places) + 1e-12).log())
    assert torch.allclose(place, places, atol=0.05)
    assert (sure > 0.98).all()
    assert read((target(places * np.nan) + 1e-12).log())[1].max() < 0.01


def test_a_peak_that_no_neighbouring_frame_has_is_passed_over():
    """In the middle frame a false peak is twice as likely as the one that moves on."""
    frames = [target(torch.tensor([[[20.0 + 2 * t, 40.0]] * 2])) for t in range(7)]
    false = target(torch.tensor([[[70.0, 10.0]] * 2]))
    frames[3] = frames[3] / 3 + false * 2 / 3
    place, sure = read((torch.cat(frames) + 1e-12).log())
    assert torch.allclose(place[3, 0], torch.tensor([26.0, 40.0]), atol=0.2)
    assert sure[3, 0].item() == pytest.approx(1 / 3, abs=0.02)  # the frame's own map is not sure
    alone, _ = read((frames[3] + 1e-12).log())
    assert torch.allclose(alone[0, 0], torch.tensor([70.0, 10.0]), atol=0.2)


def test_a_cut_is_followed_at_once():
    places = torch.tensor([[[20.0, 40.0]] * 2] * 4 + [[[60.0, 30.0]] * 2] * 4)
    assert torch.allclose(read((target(places) + 1e-12).log())[0], places, atol=0.2)


def test_looking_both_ways_mirrors_the_maps_back():
    frames = np.zeros((1, 84, 84, 12), np.uint8)
    frames[:, 40:44, 10:14] = 255
    place, _ = read(both_ways(Bright(), to_images(frames))[0])
    assert torch.allclose(place[0, 0], torch.tensor([12.0, 42.0]), atol=0.5)


def test_looking_both_ways_is_a_mean_and_no_surer_than_either_look():
    """For a network that sees the same in the mirror the two looks say the same."""
    frames = np.zeros((1, 84, 84, 12), np.uint8)
    frames[:, 40:44, 10:14] = 255
    images = to_images(frames)
    for both, one in zip(both_ways(Bright(), images), Bright()(images), strict=True):
        torch.testing.assert_close(both, one)


def test_a_lone_frame_is_its_own_witness_and_counts_by_its_root():
    p = torch.rand(1, 2, CELLS, CELLS)
    torch.testing.assert_close(detector_networks.together(p), (p + 1e-6).sqrt())


def test_the_frame_before_and_the_one_after_say_what_is_near():
    """Two steps of a cell each way: 9 to 1 for a cell that stays against one that is two cells on
    and two down, with one chance in twenty to be anywhere; three on, nothing else is left."""
    p = torch.zeros(2, 2, CELLS, CELLS)
    p[0, :, 20, 20] = 1
    p[1] = 1 / CELLS**2
    for order in (p, p.flip(0)):
        seen = detector_networks.together(order)
        seen = seen[1] if order is p else seen[0]
        far, corner, same = seen[0, 5, 5], seen[0, 22, 22], seen[0, 20, 20]
        assert ((same - far) / (corner - far)).item() == pytest.approx(9, rel=0.01)
        assert (far / seen[0, 23, 20]).item() == pytest.approx(1, rel=0.01)
        # A root of 1 here, and of a millionth in each of the other 1,763 cells.
        here = 1 / (1 + 1763e-3)
        rest = 1e-3 * here
        near = 0.95 * (9 / 81 * here + 72 / 81 * rest) + 0.05 / CELLS**2
        elsewhere = 0.95 * rest + 0.05 / CELLS**2
        assert (same / far).item() == pytest.approx(near / elsewhere, rel=0.01)


def test_two_equal_peaks_are_not_sure():
    one, two = (target(torch.full((1, 2, 2), at)) for at in (20.0, 60.0))
    assert (read(((one + two) / 2 + 1e-12).log())[1] - 0.5).abs().max() < 0.02


def test_the_losss_gradient_reaches_both_heads_and_both_masks():
    torch.manual_seed(0)
    network = Network()
    places, masks = torch.tensor([[[20.0, 30.0], [np.nan, np.nan]]]), torch.zeros(1, 2, 42, 42)
    loss(*network(torch.randn(1, 12, 84, 84)), places, masks).backward()
    maps = network.maps[0].weight.grad.flatten(1).abs().sum(1).unflatten(0, (4, 4))
    assert (maps > 0).all()
    assert (network.nowhere.weight.grad.abs().sum(1) > 0).all()
    assert all(torch.isfinite(p.grad).all() for p in network.parameters())


# Training


def easy(rng):
    """A white arm from the left that pushes a red square along a dark table."""
    T, y = 6, rng.uniform(25, 60)
    x = rng.uniform(20, 35) + np.linspace(0, 30, T) * rng.uniform(0.6, 1.2)
    tip = np.stack([x, np.full(T, y)], 1)
    frames, masks = np.full((T, 84, 84, 3), 60, np.uint8), np.zeros((T, 84, 84, 2), np.uint8)
    for frame, mask, (a, b) in zip(frames, masks, tip.astype(int), strict=True):
        for shape, colours in ((frame, ((230,) * 3, (200, 20, 20))), (mask, ((255, 0), (0, 255)))):
            cv2.line(shape, (0, b - 15), (a, b), colours[0], 3)
            cv2.rectangle(shape, (a + 2, b - 4), (a + 10, b + 4), colours[1], -1)
    masks = np.stack([cv2.resize(m, (42, 42), interpolation=cv2.INTER_AREA) for m in masks])
    return Clip(frames, np.float32(tip + 0.5), np.float32(tip + (6.5, 0.5)), masks)


def test_a_tiny_training_on_easy_drawings_beats_chance(monkeypatch):
    monkeypatch.setattr(detector, "POOL", 24)
    monkeypatch.setattr(detector, "BATCH", 8)
    monkeypatch.setattr(detector_networks, "WIDTH", 32)
    model, log = detector.train(iterations=160, seed=0, draw=easy)
    clips = [easy(np.random.default_rng([9, i])) for i in range(8)]
    # Chance: the mean place of all clips, which is the best guess without eyes.
    for what in ("tip", "object"):
        truth = np.stack([getattr(clip, what) for clip in clips])
        found = np.stack([getattr(model.detect(clip.frames), what) for clip in clips])
        chance = np.median(np.linalg.norm(truth - truth.mean((0, 1)), axis=2))
        assert np.median(np.linalg.norm(truth - found, axis=2)) < chance / 2, what
    assert log[-1]["loss"] < log[0]["loss"]


def test_a_training_that_was_cut_off_ends_as_if_nothing_had_happened(monkeypatch, tmp_path):
    monkeypatch.setattr(detector, "POOL", 8)
    monkeypatch.setattr(detector, "BATCH", 8)

    class Cut(Exception):
        pass

    class Power(Checkpoint):
        def save(self, make_state, force=False):
            super().save(make_state, force=True)
            if not force and make_state()["step"] == 5:
                raise Cut

    whole, _ = detector.train(iterations=8, seed=0, draw=easy)
    with pytest.raises(Cut):
        detector.train(
            iterations=8, seed=0, draw=easy, checkpoint=Power(tmp_path / "eyes.checkpoint")
        )
    rest, _ = detector.train(
        iterations=8, seed=0, draw=easy, checkpoint=Checkpoint(tmp_path / "eyes.checkpoint")
    )
    for a, b in zip(whole.network.parameters(), rest.network.parameters(), strict=True):
        assert torch.equal(a, b)


# Use


class Bright(torch.nn.Module):
    """Instead of a network: the tip is the brightest spot, the object nowhere."""

    def __init__(self):
        super().__init__()
        self.any = torch.nn.Parameter(torch.zeros(1))

    def forward(self, images):
        spot = torch.nn.functional.avg_pool2d(images[:, :3].mean(1, keepdim=True), 2).flatten(2)
        logits = torch.cat([20 * spot, torch.zeros_like(spot)], 1)
        last = torch.tensor([0.0, 50.0]).expand(len(images), 2)[..., None]
        return torch.cat([logits, last], 2), images[:, :2, ::2, ::2]


@pytest.mark.parametrize("shape", [(84, 84), (120, 200), (300, 170), (40, 56)])
def test_places_are_in_pixels_of_the_given_frames(shape):
    frames = np.zeros((3, *shape, 3), np.uint8)
    at = np.array([[0.3, 0.6], [0.5, 0.5], [0.7, 0.2]]) * shape[::-1]
    for frame, (x, y) in zip(frames, at, strict=True):
        size = max(shape) // 20
        frame[int(y) - size : int(y) + size, int(x) - size : int(x) + size] = 255
    found = Detector(Bright()).detect(frames)
    assert np.abs(found.tip - at.astype(int)).max() < max(shape) / 84
    assert found.tip_sure.min() > 0.5 and found.object_sure.max() < 0.01


@pytest.mark.parametrize(
    "frames",
    [np.zeros((3, 84, 84), np.uint8), np.zeros((0, 84, 84, 3), np.uint8), np.zeros((2, 9, 9, 3))],
)
def test_frames_of_another_shape_or_type_are_refused(frames):
    with pytest.raises(InputError, match="give a clip"):
        Detector(Network()).detect(frames)


def test_references_are_median_first_and_last():
    frames = np.arange(5, dtype=np.uint8)[:, None, None, None].repeat(3, 3) ** 2
    assert detector.references(frames)[:, 0, 0, 0].tolist() == [4, 0, 16]


def test_weights_come_back_from_their_file_and_others_are_refused(tmp_path):
    torch.manual_seed(0)
    model = Detector(Network())
    model.save(tmp_path / "eyes.safetensors")
    frames = draw_clip(np.random.default_rng(0)).frames
    one, two = model.detect(frames), Detector.load(tmp_path / "eyes.safetensors").detect(frames)
    assert np.abs(one.tip_sure - two.tip_sure).max() < 0.02  # half precision
    with pytest.raises(InputError, match="not the weights of a detector"):
        Detector.load(WEIGHTS / "push" / "keypoints.safetensors")


def test_a_picture_is_fitted_in_the_middle_between_two_bars():
    """40 x 120 pixels become 28 x 84, with 28 rows of black above and below."""
    frames = np.full((2, 40, 120, 3), 200, np.uint8)
    small, scale, corner = detector._fitted(frames)
    lit = small[0, :, :, 0] > 0
    assert lit[28:56].all() and lit.sum() == 28 * 84
    assert corner.tolist() == [0, 28] and scale.tolist() == pytest.approx([0.7, 0.7])
    upright, _, corner = detector._fitted(frames.transpose(0, 2, 1, 3))
    assert (upright[0, :, 28:56] == 200).all() and corner.tolist() == [28, 0]


def test_places_come_back_by_the_scale_of_each_axis(monkeypatch):
    """200 x 10 pixels become 84 x 4, from row 40 on: 0.42 and 0.4 of them."""
    places = torch.tensor([[[42.0, 42.0], [84.0, 44.0]]] * 2)
    looks = []
    monkeypatch.setattr(
        detector, "both_ways", lambda network, images: looks.append(len(images)) or [images] * 2
    )
    monkeypatch.setattr(detector, "read", lambda logits: (places, torch.ones(2, 2)))
    found, sure, _ = Detector(Network()).look(np.zeros((2, 10, 200, 3), np.uint8))
    np.testing.assert_allclose(found[0], [[100, 5], [200, 10]], rtol=1e-5)
    assert (sure == 1).all() and looks == [2]  # and in the mirror


def test_the_second_look_takes_in_what_was_found_and_stays_within_the_picture():
    """Places from 20 to 60 along x: half as much again, and 0.3 of the longer side."""
    x = np.linspace(20, 60, 101)
    place = np.stack([np.stack([x, 0 * x + 30], 1), np.stack([x, 0 * x + 50], 1)], 1)
    sure = np.ones((101, 2))
    left, top, side = detector._closer(place, sure, (200, 300))
    assert side == pytest.approx(1.5 * 0.96 * 40 + 90, abs=1)
    assert (left, top) == (0, 0)  # the middle is (40, 40)
    left, top, side = detector._closer(place + 120, sure, (200, 300))
    assert (left, top) == (160 - side // 2, 200 - side)
    place[99:] += 1000  # what is seen far away in one frame of fifty says nothing
    assert detector._closer(place, sure, (200, 300))[2] == pytest.approx(side, abs=3)
    few = sure * (np.arange(101) < 2)[:, None]
    assert detector._closer(place, few, (200, 300)) == (0, 0, 300)


def test_the_second_look_takes_in_the_tip_as_well_and_stays_within_a_tall_picture():
    """Objects at (150, 100), tips from (50, 60) to (150, 60): the middle is (100, 80)."""
    n = 200
    object_ = np.tile([150.0, 100.0], (n, 1))
    tip = np.stack([np.linspace(50, 150, n), np.full(n, 60.0)], 1)
    place, sure = np.stack([tip, object_], 1), np.ones((n, 2))
    left, top, side = detector._closer(place, sure, (400, 300))
    assert side == pytest.approx(1.5 * 96 + 120, abs=2)
    assert (left, top) == (0, 0)
    left, top, side = detector._closer(place + (140, 300), sure, (400, 300))
    assert (left, top) == (300 - side, 400 - side)


class TwoLooks(Detector):
    """The first look is told; the second sees the tip at (5, 6) of its square, and no object."""

    def __init__(self, place, sure, near_sure):
        self.looks, self.second = [], (place, sure)
        self.near = np.array(near_sure)

    def look(self, frames):
        self.looks.append(frames.shape)
        if len(self.looks) == 1:
            return *self.second, None
        n = len(frames)
        return np.tile(np.float32([5, 6]), (n, 2, 1)), np.tile(self.near, (n, 1)), None


def test_the_closer_look_counts_where_it_is_surer_and_in_the_clips_pixels():
    place = np.tile(np.float32([[150, 100], [160, 110]]), (10, 1, 1))
    sure = np.tile([0.6, 0.7], (10, 1))
    told = TwoLooks(place, sure, [0.9, 0.2])
    found = told.detect(np.zeros((10, 200, 300, 3), np.uint8))
    assert told.looks[1][1:3] == (105, 105)  # 1.5 * 10 + 0.3 * 300
    left, top = round(155 - 52.5), round(105 - 52.5)
    np.testing.assert_allclose(found.tip[0], [left + 5, top + 6], atol=1)
    np.testing.assert_allclose(found.object[0], [160, 110])
    assert found.tip_sure[0] == 0.9 and found.object_sure[0] == 0.7


def test_where_both_looks_are_sure_the_closer_one_counts():
    """It sees more pixels of a thing, though the first may be the surer by chance."""
    place = np.tile(np.float32([[150, 100], [160, 110]]), (10, 1, 1))
    told = TwoLooks(place, np.tile([0.95, 0.95], (10, 1)), [0.9, 0.2])
    found = told.detect(np.zeros((10, 200, 300, 3), np.uint8))
    np.testing.assert_allclose(found.tip[0], [102 + 5, 52 + 6], atol=1)
    assert found.tip_sure[0] == 0.9
    np.testing.assert_allclose(found.object[0], [160, 110])


def test_a_second_look_that_would_take_in_most_of_the_picture_is_left_out():
    place = np.stack([np.stack([np.linspace(0, 250, 20), np.full(20, 90)], 1)] * 2, 1)
    told = TwoLooks(np.float32(place), np.ones((20, 2)), [1.0, 1.0])
    told.detect(np.zeros((20, 200, 300, 3), np.uint8))
    assert len(told.looks) == 1


def test_the_network_sees_the_frame_and_what_differs_from_each_reference():
    """A frame that equals its references shows nothing but itself."""
    network, shown = Network(), []
    network.stem.register_forward_pre_hook(lambda _, inputs: shown.append(inputs[0]))
    frame, others = torch.rand(1, 3, 84, 84), torch.rand(1, 9, 84, 84)
    network(torch.cat([frame, others], 1))
    assert torch.equal(shown[0][:, :3], frame)
    for i in range(3):
        assert torch.allclose(
            shown[0][:, 3 + 3 * i : 6 + 3 * i], frame - others[:, 3 * i : 3 * i + 3]
        )


def test_the_loss_is_the_cross_entropy_of_places_and_ten_times_that_of_masks():
    """Even logits: log 1765 for a place, whether it is there or nowhere, and log 2 for a mask."""
    places = torch.tensor([[[20.0, 30.0], [np.nan, np.nan]]])
    masks = torch.zeros(1, 2, 42, 42)
    even = loss(torch.zeros(1, 2, CELLS**2 + 1), torch.zeros(1, 2, 42, 42), places, masks)
    assert even.item() == pytest.approx(np.log(1765) + 10 * np.log(2), rel=1e-5)
    logits = torch.zeros(1, 2, CELLS**2 + 1)
    logits[0, 1, -1] = 100.0  # sure that the object is nowhere
    rest = loss(logits, torch.full((1, 2, 42, 42), -50.0), places, masks)
    assert rest.item() == pytest.approx(np.log(1765) / 2, rel=1e-4)


def test_a_peak_is_of_nine_cells_and_no_lone_one_however_high():
    """Cell (30, 30) has 0.3, and each of nine about (10, 10) has 0.07."""
    p = torch.zeros(1, 2, CELLS, CELLS)
    p[..., 30, 30], p[..., 9:12, 9:12] = 0.3, 0.07
    place, sure = read(torch.cat([p.flatten(2), torch.full((1, 2, 1), 0.07)], 2).add(1e-9).log())
    assert torch.allclose(place[0, 0], torch.tensor([21.0, 21.0]), atol=0.01)
    assert sure[0, 0].item() == pytest.approx(0.63, abs=0.001)


def test_the_target_is_a_gaussian_of_two_pixels():
    """About the middle of cell (10, 20): exp(-1/2) of the peak a cell, 2 pixels, away."""
    p = target(torch.tensor([[[21.0, 41.0]] * 2]))[0, 0, :-1].view(CELLS, CELLS)
    assert p.argmax().item() == 20 * CELLS + 10
    for row, column in ((20, 11), (21, 10), (20, 9)):
        assert (p[row, column] / p[20, 10]).item() == pytest.approx(np.exp(-0.5), rel=1e-4)


def test_a_place_is_the_mean_of_seven_by_seven_cells_about_its_peak():
    """A quarter lies three cells from the peak, and counts; what lies four cells on does not."""
    p = torch.zeros(1, 2, CELLS, CELLS)
    p[..., 19:22, 9:12] = 0.6 / 9
    p[..., 20, 13], p[..., 20, 14] = 0.2, 0.2
    logits = torch.cat([p.flatten(2), torch.zeros(1, 2, 1)], 2).add(1e-12).log()
    places = (target(torch.tensor([[[21.0, 41.0]] * 2])) + 1e-12).log()
    # Frames before and after say where the peak is.
    place, sure = read(torch.cat([places, logits, places]))
    assert torch.allclose(place[1, 0], torch.tensor([21 + 6 * 0.25, 41.0]), atol=1e-3)
    assert sure[1, 0].item() == pytest.approx(0.8, abs=1e-3)


def test_batches_are_of_the_newest_clips_with_the_places_and_masks_of_the_frame_shown(monkeypatch):
    """Two new clips an iteration; half of the clips run backwards."""
    drawn = []

    def clip(rng):
        i = len(drawn)
        drawn.append(i)
        value = np.arange(3, dtype=np.uint8) + 10 * i
        frames = np.broadcast_to(value[:, None, None, None], (3, 84, 84, 3)).copy()
        tip = np.float32([[i, t] for t in range(3)])
        masks = np.broadcast_to(value[:, None, None, None], (3, 42, 42, 2)).copy()
        return Clip(frames, tip, tip + 100, masks)

    monkeypatch.setattr(detector, "POOL", 9)
    monkeypatch.setattr(detector, "BATCH", 8)
    rng, backwards = np.random.default_rng(0), []
    pool = detector._Pool(0, range(6), 0, clip)
    for step in range(6):
        images, places, masks = pool.batch(rng, "cpu")
        clips = [int(clip.tip[0, 0]) for clip, _ in pool.clips]
        assert clips == list(range(2 * step, 2 * step + 9)) and len(drawn) == 2 * step + 9
        grey = ((images + 1) * 127.5).round()[:, :, 0, 0]
        for shown, (tip, thing), mask in zip(grey, places, masks, strict=True):
            i, t = tip.int().tolist()
            assert thing.tolist() == [i + 100, t + 100]
            assert shown[0] == 10 * i + t and shown[3] == 10 * i + 1  # the frame, the median
            assert (mask * 255).round().unique().item() == 10 * i + t
            backwards.append((shown[6] > shown[9]).item())
            assert {shown[6].item(), shown[9].item()} == {10 * i, 10 * i + 2}
    assert 0.2 < np.mean(backwards) < 0.8
    assert next(pool.drawn, None) is None  # no clip is drawn for nothing


def test_batches_are_the_same_whoever_draws_and_where_a_training_goes_on(monkeypatch):
    monkeypatch.setattr(detector, "POOL", 9)
    monkeypatch.setattr(detector, "BATCH", 4)

    def batches(first, workers):
        pool = detector._Pool(3, range(first, 4), workers, draw_clip)
        return [pool.batch(np.random.default_rng(step), "cpu") for step in range(first, 4)]

    here = batches(0, 0)
    for others in (batches(0, 2), 2 * [None] + batches(2, 0)):
        for batch, other in zip(here, others, strict=True):
            for one, same in zip(batch, other or batch, strict=True):
                assert torch.equal(one.nan_to_num(-1), same.nan_to_num(-1))


def test_a_training_leaves_torchs_chance_alone_once_it_draws(monkeypatch):
    """Or one that was cut off would go on with other numbers than one that was not."""
    monkeypatch.setattr(detector, "POOL", 8)
    before = torch.get_rng_state()
    detector._Pool(0, range(2), 0, easy)
    assert torch.equal(torch.get_rng_state(), before)


def test_the_learning_rate_warms_up_holds_and_falls_over_the_last_three_quarters(monkeypatch):
    rates = []
    monkeypatch.setattr(detector, "POOL", 8)
    images = torch.zeros(8, 12, 84, 84), torch.zeros(8, 2, 2), torch.zeros(8, 2, 42, 42)
    monkeypatch.setattr(detector._Pool, "batch", lambda pool, rng, device: images)
    weight = torch.nn.Parameter(torch.ones(1))

    class Tiny(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.w = weight

        def forward(self, images):
            return self.w * torch.zeros(8, 2, CELLS**2 + 1), self.w * torch.zeros(8, 2, 42, 42)

    monkeypatch.setattr(detector, "Network", Tiny)
    step = torch.optim.AdamW.step
    monkeypatch.setattr(
        torch.optim.AdamW,
        "step",
        lambda self, *a: rates.append(self.param_groups[0]["lr"]) or step(self, *a),
    )
    _, log = detector.train(iterations=1000, seed=0, draw=easy)
    assert rates[0] == pytest.approx(2e-5) and rates[49] == pytest.approx(1e-3)
    assert rates[99:249] == pytest.approx(150 * [2e-3])
    assert rates[625] == pytest.approx(1e-3, rel=0.02) and rates[-1] < 2e-5
    assert [row["step"] for row in log[:3]] == [50, 100, 150]
    # Each row is the mean of its own fifty steps, which all lose the same.
    assert {row["loss"] for row in log} == {log[0]["loss"]}


def test_a_clip_is_drawn_by_the_trainings_seed_and_its_own_number():
    clips = [
        detector._Drawings(seed, draw_clip)[i][0].frames
        for seed, i in ((1, 0), (2, 0), (1, 1), (1, 0))
    ]
    assert np.array_equal(clips[0], clips[3])
    assert not any(np.array_equal(clips[0], clip) for clip in clips[1:3])


def test_each_clip_is_seen_sixteen_times():
    """When it was 32, the loss on clips of the pool was 0.6 lower than on any others. It stays for
    256 iterations, so that a batch is of clips that have little in common."""
    assert detector.BATCH / detector.NEW == 16 and detector.POOL / detector.NEW == 256


def test_a_step_is_no_longer_than_a_gradient_of_1_however_bad_a_batch_is(monkeypatch):
    norms, weight = [], torch.nn.Parameter(torch.ones(4))

    class Tiny(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.w = weight

        def forward(self, images):
            return self.w.sum(), self.w.sum()

    monkeypatch.setattr(detector, "POOL", 8)
    nothing = torch.zeros(1, 12, 8, 8), None, None
    monkeypatch.setattr(detector._Pool, "batch", lambda pool, rng, device: nothing)
    monkeypatch.setattr(detector, "Network", Tiny)
    monkeypatch.setattr(detector, "loss", lambda said, *_: 1000 * said)
    monkeypatch.setattr(detector, "LOG_EVERY", 2)

    def step(adam):
        norms.append(weight.grad.norm().item())
        (group,) = adam.param_groups  # it remembers a hundred steps, and forgets a hundredth
        assert (group["betas"], group["weight_decay"]) == ((0.9, 0.99), 0.01)

    monkeypatch.setattr(torch.optim.AdamW, "step", step)
    _, log = detector.train(iterations=2, seed=0, draw=easy)
    assert norms == pytest.approx([1, 1], rel=1e-4)
    assert log == [{"step": 2, "loss": 4000}]  # the mean of two, as the loss itself was


def test_a_detector_in_use_is_frozen():
    network = Detector(Network().train()).network
    assert not network.training and not any(p.requires_grad for p in network.parameters())


# The object by its corners


def slides(T=30, noise=1.0, cut=None):
    """A textured square that rests and then slides on a textured ground, and a noisy `Found`."""
    rng = np.random.default_rng(0)
    ground = cv2.GaussianBlur(rng.integers(60, 120, (168, 168, 3)).astype(np.uint8), (0, 0), 1.5)
    square = cv2.GaussianBlur(rng.integers(0, 255, (24, 24, 3)).astype(np.uint8), (0, 0), 1)
    path = np.stack([30 + 80 * np.clip((np.arange(T) - 8) / (T - 8), 0, 1), np.full(T, 90)], 1)
    if cut:
        path[cut:] = path[: T - cut]
    frames = np.repeat(ground[None], T, 0)
    for frame, (x, y) in zip(frames, path.round().astype(int), strict=True):
        frame[y - 12 : y + 12, x - 12 : x + 12] = square
    path = path.round()
    sure = np.ones(T, np.float32)
    found = np.float32(path + rng.normal(0, noise, path.shape))
    return frames, path, Found(found, found, sure, sure)


@pytest.mark.parametrize("cut", [None, 20])
def test_corners_take_the_noise_off_the_objects_path(cut):
    frames, path, found = slides(cut=cut)
    refined = refine(frames, found)
    wobble = (refined.object - path) - np.median(refined.object - path, axis=0)
    assert np.abs(wobble).max() < 0.5  # 1 px of noise has 2 px and more in 60 numbers
    assert np.array_equal(refined.tip, found.tip)


def test_no_corner_is_followed_over_a_cut():
    """The wall's corners stand all along; but before the cut they lie by a pan elsewhere."""
    frames, _, found = slides()
    before = np.roll(frames[:1], 6, axis=2).repeat(10, axis=0)
    sure = np.concatenate([np.zeros(10, np.float32), found.object_sure])
    places = np.concatenate([found.object[:1].repeat(10, axis=0), found.object])
    refined = refine(np.concatenate([before, frames]), Found(places, places, sure, sure), [10])
    alone = refine(frames, found)
    np.testing.assert_array_equal(refined.object[10:], alone.object)
    assert not refined.object_sure[:10].any()


def test_an_object_that_is_not_found_is_not_followed():
    frames, _, found = slides()
    nowhere = Found(found.tip, found.object, found.tip_sure, 0 * found.object_sure)
    refined = refine(frames, nowhere)
    assert np.array_equal(refined.object, found.object) and refined.object_sure.max() == 0


def test_the_grounds_corners_are_not_the_objects():
    T, unit = 20, 1.0
    path = np.stack([np.linspace(20, 50, T), np.full(T, 40.0)], 1)
    own, still = path + (2, 1), np.full((T, 2), 35.0)
    far = path + (40, 0)  # moves alike, but is elsewhere
    which, middle = corners.objects_own(np.stack([own, still, far], 1), path, unit)
    assert which.tolist() == [True, False, False]
    assert np.allclose(middle[0], (-2, -1))


def test_corners_are_followed_to_a_tenth_of_a_pixel_from_the_pictures_edge():
    """A texture goes by (3, 1) pixels a frame, and so do they; a pixel's middle is at 0.5."""
    rng = np.random.default_rng(0)
    wide = cv2.GaussianBlur(rng.integers(0, 255, (160, 200)).astype(np.uint8), (0, 0), 2)
    grey = np.stack([wide[20 - t : 120 - t, 30 - 3 * t : 150 - 3 * t] for t in range(5)])
    paths = corners.follow(grey)
    whole = np.isfinite(paths).all((0, 2))
    assert whole.sum() > 20
    steps = np.diff(paths[:, whole], axis=0)
    assert np.abs(np.median(steps, axis=(0, 1)) - [3, 1]).max() < 0.05
    first = cv2.goodFeaturesToTrack(grey[0], 500, 0.005, 2)[:, 0]
    np.testing.assert_allclose(paths[0], first + 0.5)


def test_a_corner_that_does_not_come_back_is_lost():
    """Behind a bar that comes down there is nothing to come back to."""
    rng = np.random.default_rng(0)
    still = cv2.GaussianBlur(rng.integers(0, 255, (100, 120)).astype(np.uint8), (0, 0), 2)
    hidden = still.copy()
    hidden[:, 40:80] = rng.integers(0, 255, (100, 40))
    paths = corners.follow(np.stack([still, still, hidden]))
    behind = np.abs(paths[0, :, 0] - 60) < 12
    lost = ~np.isfinite(paths[2, :, 0])
    assert lost[behind].mean() > 0.9 and lost[np.abs(paths[0, :, 0] - 60) > 32].mean() < 0.1


def own(corner, path):
    return corners.objects_own(corner[:, None], path, 1.0)[0].tolist()[0]


def test_a_corner_is_the_objects_if_it_is_near_and_moves_alike():
    """Near is 12 of 84 pixels, alike 1.5: x and y off their median, half of the time less."""
    path = np.stack([np.linspace(20, 60, 9), np.full(9, 50.0)], 1)
    wobble = np.array([1.0, -1, 1, -1, 0, 1, -1, 1, -1])[:, None] * (1, 0)
    assert own(path + (0, 11), path) and not own(path + (0, 13), path)
    assert own(path + 1.3 * wobble, path) and not own(path + 1.8 * wobble, path)


def test_a_corner_is_the_objects_if_it_goes_a_quarter_of_its_way_and_two_pixels():
    """The object stands almost all the time, so a corner that stands is as like it."""
    for far, goes, is_own in ((40, 12, True), (40, 8, False), (6, 2.5, True), (6, 1.8, False)):
        path = np.stack([20 + far * (np.arange(9) == 8), np.full(9, 50.0)], 1)
        corner = np.stack([20 + goes * (np.arange(9) == 8), np.full(9, 53.0)], 1)
        assert own(corner, path) == is_own, (far, goes)


@pytest.mark.parametrize(("goes", "is_own"), [(9.5, True), (10.5, False)])
def test_what_goes_twice_as_far_as_the_object_and_two_pixels_is_not_its_own(goes, is_own):
    """The object stirs by 4 in the end, and what is beside it goes away then."""
    path = np.stack([20 + 4.0 * (np.arange(9) == 8), np.full(9, 50.0)], 1)
    corner = np.stack([20 - goes * (np.arange(9) == 8), np.full(9, 53.0)], 1)
    assert own(corner, path) == is_own
    path[8] = np.nan  # where the object is not seen it may have gone as far
    assert own(corner, path)


@pytest.mark.parametrize(("comes", "is_own"), [(1.9, True), (2.1, False)])
def test_what_comes_while_the_object_rests_is_not_its_own(comes, is_own):
    """A fingertip goes with a thing of which most frames show the way, from the touch on."""
    path = np.stack([np.maximum(20.0, 14 + 3 * np.arange(12)), np.full(12, 50.0)], 1)
    corner = path + (0, 3) + np.array([comes, 0]) * (np.arange(12) == 0)[:, None]
    assert own(corner, path) == is_own


def test_a_corner_has_to_be_seen_with_the_object_in_three_frames():
    path = np.stack([np.linspace(20, 60, 9), np.full(9, 50.0)], 1)
    for seen, is_own in (([0, 4, 8], True), ([0, 8], False)):
        corner = np.full((9, 2), np.nan)
        corner[seen] = path[seen] + 1
        assert own(corner, path) == is_own


def test_large_frames_are_shrunk_and_places_come_back_in_their_pixels():
    """720 pixels wide: followed at 480."""
    frames, path, found = slides(T=16)
    large = np.stack([cv2.resize(f, (720, 720), interpolation=cv2.INTER_CUBIC) for f in frames])
    scale = 720 / 168
    refined, known = corners.followed(large, found.object * scale)
    off = (refined - path * scale)[known]
    assert known.mean() > 0.8 and np.abs(off - np.median(off, axis=0)).max() < 0.6 * scale
    assert np.abs(np.median(off, axis=0)).max() < scale


def test_where_corners_say_where_it_is_the_object_is_as_sure_as_usual():
    """Frames in which it was hardly seen are as sure as the median of those where it was."""
    frames, path, found = slides()
    sure = np.full(30, 0.8, np.float32)
    sure[12:16], sure[20] = 0.2, 0.95
    place = found.object.copy()
    place[12:16] = (150, 20)  # anywhere
    refined = refine(frames, Found(found.tip, place, sure, sure))
    assert refined.object_sure[12:16] == pytest.approx(4 * [0.8])
    assert refined.object_sure[20] == pytest.approx(0.95)
    assert np.abs(refined.object[12:16] - path[12:16]).max() < 2


# What is shipped


@pytest.fixture(scope="module")
def shipped():
    return Detector.load(WEIGHTS / "eyes" / "eyes.safetensors")


@pytest.fixture(scope="module")
def stated():
    return json.loads((WEIGHTS / "eyes" / "metrics.json").read_text())["error"]


def test_weights_are_small():
    assert (WEIGHTS / "eyes" / "eyes.safetensors").stat().st_size < 1_500_000


def test_shipped_weights_find_tip_and_object_in_drawings_held_out(shipped):
    errors = {"tip": [], "object": []}
    for i in range(20):
        clip = draw_clip(np.random.default_rng([1_000_000, i]))
        found = shipped.detect(clip.frames)
        for what, kept in errors.items():
            sure = getattr(found, f"{what}_sure") > detector.SURE
            e = np.linalg.norm(getattr(found, what) - getattr(clip, what), axis=1)[sure]
            kept.append(e[np.isfinite(e)])
    for what, kept in errors.items():
        assert np.median(np.concatenate(kept)) < 4, what  # pixels of 84


def test_shipped_weights_find_tip_and_object_in_a_human_video(shipped, stated):
    frames, _ = video.read(VIDEOS / "push" / "expert_01.mp4")
    states = load_recordings(VIDEOS / "push" / "experts.npz")[0].states
    env = bare("push", embodiment="human")
    found = refine(frames, shipped.detect(frames))
    for what, k in (("tip", 0), ("object", 3)):
        truth = np.array([env.world.pixel(point) for point in states[:, k : k + 3]])
        sure = getattr(found, f"{what}_sure") > detector.SURE
        error = np.linalg.norm(getattr(found, what) - truth, axis=1)[sure]
        figures = stated["push's videos"][what]
        assert sure.mean() > 0.8 * figures["found"]
        assert np.median(error) < min(4, 1.3 * figures["p90"])
