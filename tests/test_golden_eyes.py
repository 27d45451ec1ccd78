"""The eyes still learn, look, follow and mend as when the shipped ones were made and measured."""

import itertools
import json
from contextlib import nullcontext

import cv2
import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file

from lbw_minimal.clips import corners, detector, detector_networks, patches
from lbw_minimal.clips.detector import Detector, Found
from lbw_minimal.clips.drawings import Clip, draw_clip
from lbw_minimal.images import to_images
from lbw_minimal.training import Checkpoint, InputError
from tasks.commands.eyes import Seen, compare
from tests.toy_chance import Told, cells
from tests.toy_clips import room

# The network


@pytest.fixture(scope="module")
def looked():
    """A network as it is made, and what it says of a batch; the second place is nowhere."""
    torch.manual_seed(7)
    network = detector_networks.Network()
    clips = [draw_clip(np.random.default_rng(seed), 4) for seed in (1, 2)]
    frames = [clip.frames[[1, 0, 2, 3]].transpose(1, 2, 0, 3).reshape(84, 84, 12) for clip in clips]
    images = to_images(np.stack(frames)).contiguous()
    return network, images, *network(images)


PLACES = torch.tensor([[[20.3, 61.9], [np.nan, np.nan]], [[1.2, 33.0], [70.7, 48.4]]])


def by_module(network, of):
    return [of(p).item() for p in network.parameters()]


def test_the_network_and_its_first_gradients_are_those_that_were_trained(looked, golden):
    network, _, logits, masks = looked
    out, map_ = logits.detach(), masks.detach()
    shown = torch.linspace(0, 1, 42).expand(2, 2, 42, 42) * torch.tensor([[[1.0]], [[0.4]]])
    error = detector_networks.loss(logits, masks, PLACES, shown)
    network.zero_grad()
    error.backward(retain_graph=True)
    shapes = {name: list(value.shape) for name, value in network.state_dict().items()}
    golden(
        {
            "sizes": [*shapes, *(str(shape) for shape in shapes.values())],
            "logits": [*out[..., -1].ravel(), *out.std((0, 2)), *out.abs().mean((1, 2))],
            "maps": cells(out[1, 1, :-1].unflatten(0, (42, 42)) * 100),
            "masks": cells(map_[1, 0] * 100),
            "loss": [error.item(), detector_networks.loss(out, map_, PLACES, 0 * shown)],
            "gradients": by_module(network, lambda p: p.grad.norm()),
        },
        atol=1e-4,
    )


def test_maps_are_taught_and_read_as_they_were(looked, golden):
    network, images, _, _ = looked
    taught = detector_networks.target(PLACES)
    with torch.no_grad():
        both, _ = detector_networks.both_ways(network, images)
        # A path with a jump, a false peak and frames of which each is less sure than the last.
        x = torch.tensor([10.0, 14.4, 18.0, 60.0, 26.0, 29.5, 34.0])
        way = torch.stack([torch.stack([x, 20 + x / 2], 1), torch.stack([83 - x, 2 * x / 3], 1)], 1)
        p = detector_networks.target(way)
        p = p / (1 + torch.arange(7.0))[:, None, None] + 0.1 / 1765 * torch.arange(7)[:, None, None]
        place, sure = detector_networks.read((p + 1e-9).log())
        together = detector_networks.together(p[..., :-1].unflatten(2, (42, 42)))
    ramp = torch.arange(1764.0) ** 0.5
    golden(
        {
            "middles": detector_networks.middles()[::9],
            "taught": [*taught.amax(2).ravel(), *taught[..., -1].ravel(),
                       *(taught[..., :-1] @ ramp).ravel(), *taught.square().sum(2).ravel()],
            "both ways": [*both[..., -1].ravel(), *both.std((0, 2)),
                          *(both[..., :-1] @ ramp).ravel()],
            "places": place,
            "sure": sure,
            "together": [*together.mean((2, 3)).ravel().log(),
                         *together.amax((2, 3)).ravel().log()],
        }
    )  # fmt: skip


# Training


def quick(rng):
    """A clip that is drawn in no time, unlike in all its frames."""
    base = rng.uniform(20, 200, (6, 6, 3)).astype(np.float32)
    wall = cv2.resize(base, (84, 84), interpolation=cv2.INTER_LINEAR)
    frames, masks = np.stack([wall] * 5).astype(np.uint8), np.zeros((5, 42, 42, 2), np.uint8)
    tip = np.float32(rng.uniform(8, 40, 2) + np.arange(5)[:, None] * (6, 3))
    thing = tip + np.float32((9, 5))
    thing[0] = np.nan
    for t, (x, y) in enumerate(tip.astype(int).tolist()):
        frames[t, y : y + 4, :x] = (230, 180, 150)
        frames[t, y + 3 : y + 9, x + 5 : x + 13] = (30, 60, 200)
        masks[t, y // 2 : y // 2 + 2, : x // 2, 0] = 255
        masks[t, (y + 3) // 2 : (y + 9) // 2, (x + 5) // 2 : (x + 13) // 2, 1] = 200
    return Clip(frames, tip, thing, masks)


def test_three_updates_of_the_eyes(golden, monkeypatch):
    monkeypatch.setattr(detector, "bfloat16", lambda to: nullcontext())  # some processors know it
    monkeypatch.setattr(detector, "POOL", 36)
    monkeypatch.setattr(detector, "LOG_EVERY", 2)
    begun, kept = {}, {}

    class Kept(Checkpoint):
        def resume(self, parts, **numbers):
            begun.update({k: v.clone() for k, v in parts["network"].state_dict().items()})
            kept.update(parts, rates=[])
            return super().resume(parts, **numbers)

        def save(self, make_state, force=False):
            kept["rates"].append(kept["optimizer"].param_groups[0]["lr"])
            kept["forced"] = [*kept.get("forced", []), force]

    model, log = detector.train(iterations=3, seed=5, draw=quick, checkpoint=Kept(None))
    ended = model.network.state_dict()
    moved = [(ended[name] - begun[name]).abs().mean().item() * 1e4 for name in begun]
    adam = kept["optimizer"].state_dict()
    golden(
        {
            "log": [row["loss"] for row in log],
            "steps": [row["step"] for row in log],
            "rates": kept["rates"],
            "forced": kept["forced"],
            "moved": moved,
            "adam": adam["param_groups"][0]["betas"],
            "decay": adam["param_groups"][0]["weight_decay"],
            "seen": [state["exp_avg"].norm() for state in adam["state"].values()],
            "next draw": kept["rng"].random(3),
        },
        rtol=5e-3,  # sums of steps whose signs a rounding may turn where a gradient is next to none
        atol=1e-6,
    )


def test_a_batch_is_drawn_as_it_was(golden, monkeypatch):
    monkeypatch.setattr(detector, "POOL", 36)
    pool = detector._Pool(3, range(1, 3), 0, quick)

    class All(Told):
        def choice(self, of, size=None, replace=True):
            return self.rng.choice(of, size, replace=replace)

    rng = All(2)
    images, places, masks = pool.batch(rng, "cpu")
    assert (images.dtype, places.dtype, masks.dtype) == (torch.float32,) * 3
    golden(
        {
            "shapes": [*images.shape, *places.shape, *masks.shape],
            "images": images.mean((2, 3))[:6],
            "places": places.nan_to_num(-1)[:12],
            "masks": masks.mean((2, 3)),
            "draws": rng.draws[:24],
            "constants": [detector.POOL, detector.NEW, detector.BATCH, detector.AHEAD],
        }
    )


# Looking


class Fixed(torch.nn.Module):
    """Says what the pictures' middle columns look like, so that all that is fed to it shows."""

    def __init__(self):
        super().__init__()
        self.weight = torch.nn.Parameter(torch.linspace(-1, 1, 12))

    def forward(self, images):
        seen = (images * self.weight[:, None, None]).sum(1)
        maps = torch.nn.functional.avg_pool2d(seen[:, None], 2)[:, 0]
        maps = maps * torch.linspace(0.5, 1.5, 42)  # it sees otherwise in a mirror
        maps = torch.stack([9 * maps, -6 * maps], 1).flatten(2)
        return torch.cat([maps, maps.mean(2, keepdim=True)], 2), 0 * images[:, :2, ::2, ::2]


def a_clip(height, width, T=70):
    """A hand that comes to a thing and pushes it on, in a picture of any size."""
    rng = np.random.default_rng(4)
    wall = cv2.GaussianBlur(room(height, width, 3), (0, 0), 2)
    frames = np.repeat(wall[None], T, axis=0)
    hand = np.stack([np.interp(np.arange(T), [0, 8, T - 6], [0.1, 0.1, 0.75]) * width,
                     np.full(T, 0.5 * height)], 1)  # fmt: skip
    thing = np.stack([np.maximum(0.45 * width, hand[:, 0] + 0.11 * width),
                      np.full(T, 0.55 * height)], 1)  # fmt: skip
    r = round(0.08 * min(height, width))
    blocks = rng.choice([10, 120, 245], (4, 4, 3)).astype(np.uint8)
    mark = cv2.resize(blocks, (2 * r, 2 * r), interpolation=cv2.INTER_NEAREST)
    for frame, (x, y), (u, v) in zip(frames, hand.astype(int), thing.astype(int), strict=True):
        frame[v - r : v + r, u - r : u + r] = mark
        cv2.rectangle(frame, (x - r, 0), (x + r, y), (60, 60, 110), -1)
    return frames, hand, thing


@pytest.mark.parametrize("size", [(60, 112), (150, 96), (84, 84), (40, 52)])
def test_frames_are_fitted_and_read_back_as_they_were(size, golden):
    frames, _, _ = a_clip(*size)
    small, scale, corner = detector._fitted(frames[::9])
    around = detector.references(small)
    place, sure, _ = Detector(Fixed()).look(frames)
    golden(
        {
            "fitted": cells(small[3]), "scale": scale, "corner": corner,
            "around": around.mean((1, 2)), "median of 60": detector.references(frames).mean((1, 2)),
            "with": detector.with_references(small, around).mean((0, 1, 2)),
            "places": place[::12], "sure": sure[::12],
        },
        atol=1e-3,
    )  # fmt: skip


def test_eyes_are_kept_in_half_precision_under_their_kind(tmp_path):
    network = detector_networks.Network()
    Detector(network).save(tmp_path / "eyes.safetensors")
    kept = load_file(tmp_path / "eyes.safetensors")
    assert {value.dtype for value in kept.values()} == {torch.float16}
    with safe_open(tmp_path / "eyes.safetensors", "pt") as file:
        kind, task, (model, _) = json.loads(file.metadata()["tree"])["dict"]
    assert (kind, task, model) == (["kind", {"value": "eyes"}], ["task", {"value": "any"}], "model")
    back = Detector.load(tmp_path / "eyes.safetensors").network
    assert not back.training
    for name, value in network.state_dict().items():
        torch.testing.assert_close(back.state_dict()[name], value.half().float())
    with pytest.raises(InputError, match=r"frames are \(9, 84, 84\) uint8; give a clip"):
        Detector(network).detect(np.zeros((9, 84, 84), np.uint8))
    for wrong in (np.zeros((0, 84, 84, 3), np.uint8), np.zeros((9, 84, 84, 3), np.int16),
                  np.zeros((9, 84, 84, 4), np.uint8)):  # fmt: skip
        with pytest.raises(InputError, match="give a clip"):
            Detector(network).detect(wrong)


def test_a_second_look_is_as_close_and_counts_as_it_did(golden):
    rng = np.random.default_rng(0)
    place, figures = rng.uniform((30, 20), (90, 70), (40, 2, 2)), {}
    sure = rng.uniform(0.3, 1, (40, 2))
    for name, shape in (("wide", (120, 200)), ("high", (300, 100)), ("small", (60, 60))):
        figures[name] = detector._closer(place, sure, shape)
        figures[f"shifted {name}"] = detector._closer(place / 3 + (70, 30), sure, shape)
    few = np.where(np.arange(40)[:, None] < 2, 0.9, 0.1).repeat(2, 1)
    figures["two"] = detector._closer(place, few, (120, 200))
    figures["three"] = detector._closer(place, np.roll(few + 0.9 * few[::-1], 2, 0), (120, 200))
    golden(figures)


def test_what_is_looked_at_twice_is_put_together_as_it_was(golden, monkeypatch):
    """The first look sees a small thing in a large picture; the second is surer of some frames."""
    looks, seen = itertools.count(), []
    rng = np.random.default_rng(1)
    far = rng.uniform((100, 40), (150, 60), (9, 2, 2)).astype(np.float32)

    def look(self, frames):
        seen.append(frames.shape)
        if next(looks) % 2:
            return rng.uniform(0, 60, (9, 2, 2)).astype(np.float32), rng.uniform(0, 0.8, (9, 2)), 0
        return far, rng.uniform(0.3, 0.9, (9, 2)), 0

    monkeypatch.setattr(Detector, "look", look)
    found = Detector(Fixed()).detect(np.zeros((9, 160, 240, 3), np.uint8))
    golden({name: getattr(found, name) for name in vars(found)} | {"seen": np.ravel(seen)})


# Corners and patches


@pytest.fixture(scope="module")
def pushed():
    frames, hand, thing = a_clip(120, 200, 32)
    rng = np.random.default_rng(2)
    noise = rng.normal(0, np.linspace(4, 110, 32)[:, None, None, None], frames.shape)
    frames = np.clip(frames + noise, 0, 255).astype(np.uint8)  # it gets dark
    sure = np.where(np.arange(32) % 7 == 3, 0.3, rng.uniform(0.6, 1, 32)).astype(np.float32)
    tip_sure = np.where(np.arange(32) % 5 == 2, 0.3, 0.9).astype(np.float32)
    noisy = (thing + rng.normal(0, 1.2, thing.shape)).astype(np.float32)
    return frames, Found(hand.astype(np.float32), noisy, tip_sure, sure), hand, thing


def test_the_objects_corners_are_followed_as_they_were(pushed, golden):
    frames, found, _, thing = pushed
    refined = detector.refine(frames, found, (25,))
    grey = np.stack([cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY) for frame in frames])
    paths = corners.follow(grey[:12])
    own, middle = corners.objects_own(corners.follow(grey), found.object, 200 / 84)
    # Nothing is to be seen at first, and then the picture jumps twice.
    late = np.concatenate([0 * frames[:7], frames[:12], frames[::-1][:4], frames[:20]])
    way = np.concatenate([thing[:19], thing[::-1][:4], thing[:20]])
    again, known = corners.followed(late, np.where(np.arange(43)[:, None] % 9 == 5, np.nan, way))
    golden(
        {
            "again": np.nan_to_num(again[::2], nan=-1), "known": known,
            "object": refined.object[::3], "sure": refined.object_sure,
            "corners": [paths.shape[1], np.isfinite(paths).sum(), np.nanmean(paths), own.sum()],
            "middle": middle[own].mean(0),
            "constants": [corners.FOLLOWED, *corners.WINDOW, corners.BACK, corners.CORNERS],
        },
        rtol=2e-3,
        atol=0.05,  # pixels
    )  # fmt: skip


def test_what_corners_tell_is_as_sure_as_what_was_seen_where_they_tell_it(monkeypatch):
    """Half-way between 0.6 and 0.7; what is surer stays so, and so does what they do not tell."""
    told = np.arange(12.0).reshape(6, 2), np.array([1, 1, 1, 1, 0, 0], bool)
    monkeypatch.setattr(detector, "followed", lambda frames, path: told)
    sure = np.float32([0.6, 0.7, 0.2, 0.3, 0.9, 0.1])
    place = np.full((6, 2), 50, np.float32)
    found = detector.refine(np.zeros((6, 9, 9, 3)), Found(place, place, sure, sure))
    assert found.object_sure == pytest.approx([0.65, 0.7, 0.65, 0.65, 0.9, 0.1])
    assert found.object[:, 0].tolist() == [0, 2, 4, 6, 50, 50]
    assert found.tip is place and found.tip_sure is sure


def test_patches_are_looked_for_and_chosen_as_they_were(pushed, golden):
    """The hand was taken for the object; in the second shot, which is mirrored, it was not."""
    frames, found, hand, thing = pushed
    wrong = Found(found.tip, hand.astype(np.float32), found.tip_sure, found.object_sure)
    mirrored = Found((200, 0) + (-1, 1) * found.tip, (200, 0) + (-1, 1) * thing,
                     found.tip_sure, found.object_sure)  # fmt: skip
    both = zip(vars(wrong).values(), vars(mirrored).values(), strict=True)
    shots = np.concatenate([frames, frames[:, :, ::-1]])
    both = Found(*map(np.concatenate, both))
    mend = [
        patches.mended(shots[part], Found(*(values[part] for values in vars(both).values())))[0]
        for part in (slice(32), slice(32, 64))
    ]
    small, figures = patches.shrunk(frames[::2], 0.8), {}
    tip = patches.tip_at(found, np.arange(0, 32, 2), 0.8)
    places = [(0, 0.8 * thing[0]), (15, 0.8 * thing[30]), (4, (3.0, 30)), (2, (159.0, 95))]
    some = patches.paths(small, places, tip)
    for i, path in enumerate(some):
        figures[f"path {i}"] = [*path.places[::2].ravel(), path.side]
        figures[f"is {i}"] = [path.way, path.start, path.alone, path.worth, path.seen, path.pushed]
        figures[f"alike {i}"] = path.alike[::3]
    golden(
        figures
        | {
            "object": np.concatenate([one.object for one in mend])[::4],
            "sure": np.concatenate([one.object_sure for one in mend])[::4],
            "small": [one.mean() for one in small],
            "changed": np.ravel(patches._changed(small)), "tip": tip,
            "peaks": np.concatenate([np.ravel(part) for part in patches._peaks(
                cv2.GaussianBlur(np.random.default_rng(0).random((30, 40)), (0, 0), 2) - 0.4)]),
        },
        rtol=2e-3, atol=2e-3,
    )  # fmt: skip


def test_errors_are_put_into_figures_as_they_were(golden):
    rng = np.random.default_rng(3)
    clips = []
    for unit, n in ((1.0, 12), (2.5, 9)):
        truth = rng.uniform(0, 84, (2, n, 2)) * unit
        places = truth + unit * rng.exponential(2, truth.shape)
        truth[0, ::4], truth[1, 1::3] = np.nan, np.nan
        clips.append(Seen(Found(*places, *rng.uniform(0.2, 1, (2, n))), *truth, unit))
    figures = compare(clips)
    nowhere = compare([clips[0]._replace(object=np.full((12, 2), np.nan))])
    golden({f"{a} {b}": v for a, row in figures.items() for b, v in row.items()}
           | {f"nowhere {b}": v for b, v in nowhere["object"].items()})  # fmt: skip
