"""Claims about the drawings, the detector that learns from them, and what it finds."""

import json

import cv2
import numpy as np
import pytest
import torch

from lbw_minimal import video
from lbw_minimal.clips import corners, detector, drawings
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
    monkeypatch.setattr(drawings, "_bystander", lambda *_: lambda t: drawings.draw.empty())
    monkeypatch.setattr(drawings, "_developed", lambda rng, f: f.clip(0, 255).astype(np.uint8))


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


def test_the_same_seed_draws_the_same_clip_and_another_seed_another():
    one, same, other = (draw_clip(np.random.default_rng(seed)) for seed in (4, 4, 5))
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(one, same, strict=True))
    assert not np.array_equal(one.frames, other.frames)


def test_a_table_below_the_picture_can_be_drawn():
    """Of five thousand clips the one in which things would have stood between 88 and 84."""
    assert draw_clip(np.random.default_rng([0, 4780])).frames.any()


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
    place, _ = read(both_ways(Bright(), to_images(frames)))
    assert torch.allclose(place[0, 0], torch.tensor([12.0, 42.0]), atol=0.5)


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
    monkeypatch.setattr(detector, "draw_clip", easy)
    monkeypatch.setattr(detector, "POOL", 24)
    model, log = detector.train(iterations=100, seed=0)
    clips = [easy(np.random.default_rng([9, i])) for i in range(8)]
    # Chance: the mean place of all clips, which is the best guess without eyes.
    for what in ("tip", "object"):
        truth = np.stack([getattr(clip, what) for clip in clips])
        found = np.stack([getattr(model.detect(clip.frames), what) for clip in clips])
        chance = np.median(np.linalg.norm(truth - truth.mean((0, 1)), axis=2))
        assert np.median(np.linalg.norm(truth - found, axis=2)) < chance / 2, what
    assert log[-1]["loss"] < log[0]["loss"]


def test_a_training_that_was_cut_off_ends_as_if_nothing_had_happened(monkeypatch, tmp_path):
    monkeypatch.setattr(detector, "draw_clip", easy)
    monkeypatch.setattr(detector, "POOL", 8)

    class Cut(Exception):
        pass

    class Power(Checkpoint):
        def save(self, make_state, force=False):
            super().save(make_state, force=True)
            if not force and make_state()["step"] == 5:
                raise Cut

    whole, _ = detector.train(iterations=8, seed=0)
    with pytest.raises(Cut):
        detector.train(iterations=8, seed=0, checkpoint=Power(tmp_path / "eyes.checkpoint"))
    rest, _ = detector.train(
        iterations=8, seed=0, checkpoint=Checkpoint(tmp_path / "eyes.checkpoint")
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
        return torch.cat([logits, last], 2), None


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


# What is shipped


@pytest.fixture(scope="module")
def shipped():
    return Detector.load(WEIGHTS / "eyes" / "eyes.safetensors")


@pytest.fixture(scope="module")
def stated():
    return json.loads((WEIGHTS / "eyes" / "metrics.json").read_text())["error"]


def test_weights_are_small():
    assert (WEIGHTS / "eyes" / "eyes.safetensors").stat().st_size < 1_000_000


def test_shipped_weights_find_tip_and_object_in_drawings_held_out(shipped):
    errors = {"tip": [], "object": []}
    for i in range(40):
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
