"""Random changes of images move what they say, and nothing else."""

import pytest
import torch

from lbw_minimal.augment import degraded, recoloured, shifted


@pytest.fixture
def dots():
    """Sixteen images, each with one white pixel, and where it is in units of z."""
    torch.manual_seed(0)
    y, at = torch.zeros(16, 3, 84, 84), torch.randint(10, 74, (16, 2))
    y[torch.arange(16), :, at[:, 1], at[:, 0]] = 1
    return y, (at + 0.5) / 42 - 1


def brightest(y):
    cell = y.sum(1).flatten(1).argmax(1)
    return (torch.stack([cell % 84, cell // 84], 1) + 0.5) / 42 - 1


def test_a_shift_moves_everything_as_far_as_it_says(dots):
    y, z = dots
    seen, moved = shifted(y, 3)
    assert torch.allclose(brightest(seen) - moved[:, 0], z, atol=1e-6)
    pixels = (moved * 42).round()
    assert pixels.abs().max() == 3 and len(pixels.unique(dim=0)) > 8


def test_a_shift_repeats_the_edge():
    y = torch.arange(84.0).expand(4, 3, 84, 84)  # each column its number
    seen, moved = shifted(y, 2)
    for image, right in zip(seen, (moved[:, 0, 0] * 42).round(), strict=True):
        assert torch.equal(image[0, 0], (torch.arange(84.0) - right).clamp(0, 83))


def test_a_hue_turns_and_grey_stays():
    torch.manual_seed(0)
    red = torch.tensor([1.0, -1, -1])[None, :, None, None].expand(64, 3, 84, 84)
    grey = torch.full((64, 3, 84, 84), 0.3)
    assert torch.allclose(recoloured(grey, 180), grey, atol=1e-6)
    turned = recoloured(red, 180)[:, :, 0, 0]
    assert torch.allclose(turned.sum(1), torch.full((64,), -1.0), atol=1e-5)  # as bright as before
    away = (turned - red[:, :, 0, 0]).norm(dim=1)
    assert 16 < (away > 0.05).sum() < 48 and away.max() > 2  # half of them, and far
    assert torch.allclose(recoloured(red, 0), red, atol=1e-6)


def test_a_poor_camera_moves_nothing(dots):
    y, z = dots
    assert torch.allclose(brightest(degraded(20 * y)), z, atol=1 / 42 + 1e-6)  # blur is 3 px wide
