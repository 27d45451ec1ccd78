"""Frames and images: the way there and back, the median, and the weight of what moves."""

import numpy as np
import torch
from moves import facts, noise

from lbw_minimal import images
from lbw_minimal.images import median_frame, motion_weight, spread, to_frames, to_images


def test_frames_survive_the_way_to_images_and_back():
    frames = np.arange(192, dtype=np.uint8).reshape(2, 4, 8, 3)
    images = to_images(frames)
    assert images.shape == (2, 3, 4, 8) and np.array_equal(to_frames(images), frames)
    assert images.is_contiguous()  # each channel in one piece, whichever way layers then go


def test_black_is_minus_one_and_white_is_one():
    frames = np.array([0, 255], np.uint8).reshape(2, 1, 1, 1).repeat(3, -1)
    assert to_images(frames)[:, 0, 0, 0].tolist() == [-1, 1]


def test_images_beyond_the_range_become_black_and_white():
    images = torch.tensor([-1.5, 1.5]).view(2, 1, 1, 1).expand(2, 3, 1, 1)
    assert to_frames(images)[:, 0, 0, 0].tolist() == [0, 255]


def test_some_frames_are_spread_from_the_first_to_the_last():
    assert spread(np.arange(9), 3).tolist() == [0, 4, 8]
    assert spread(np.arange(10), 4).tolist() == [0, 3, 6, 9]
    assert spread(np.arange(3), 60).tolist() == [0, 1, 2]


def test_median_is_each_pixels_own():
    frames = np.zeros((3, 1, 2, 3), np.uint8)
    frames[:, 0, 0, 0], frames[:, 0, 1, 2] = (1, 9, 2), (7, 7, 0)
    assert median_frame(frames).tolist() == [[[[2, 0, 0], [0, 0, 7]]]]


def test_motion_weight_is_one_on_the_median_frame_and_grows_with_the_distance():
    median, image = torch.zeros(1, 3, 2, 2), torch.zeros(1, 3, 2, 2)
    image[0, :, 0, 1] = torch.tensor([0.2, -0.4, 0.6])  # mean distance 0.4
    weight = motion_weight(image, median, 5.0)
    assert torch.allclose(weight, torch.tensor([[[[1.0, 3.0], [1.0, 1.0]]]]))


def test_without_a_median_every_pixel_weighs_the_same():
    weight = motion_weight(torch.rand(2, 3, 4, 4), None, 5.0)
    assert weight.shape == (2, 1, 4, 4) and (weight == 1).all()


def test_nobody_learns_through_the_motion_weight():
    images = torch.zeros(1, 3, 2, 2, requires_grad=True)
    assert not motion_weight(images, torch.ones(1, 3, 2, 2), 5.0).requires_grad


def test_images_are_converted_as_they_were(golden):
    """Between grey levels and beyond them, in halves of numbers too; even numbers of frames."""
    frames = np.random.default_rng(0).integers(0, 256, (6, 2, 3, 3), np.uint8)
    v = 0.7 * noise(2, 3, 3, 2, seed=1)
    median = torch.zeros(1, 3, 3, 2) + torch.tensor([0.1, -0.4, 0.3]).view(3, 1, 1)
    golden(facts(images) | {
        "images": to_images(frames[:2] / 1.5),
        "frames": to_frames(v),
        "in halves": to_frames(v.half()),
        "spread": np.concatenate([spread(np.arange(n), 8) for n in (3, 8, 17, 100)]),
        "median": median_frame(frames),
        "weights": motion_weight(v, median, 20.0),
    })  # fmt: skip
