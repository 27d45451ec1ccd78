"""Random changes of images move what they say, and nothing else."""

import pytest
import torch
from moves import facts, look, noise

from lbw_minimal import augment
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


def test_a_turned_hue_is_as_bright_and_as_strong_and_turned_to_either_side():
    """By the angle about the grey axis, up to 90 degrees here, each image by its own."""
    torch.manual_seed(0)
    y = torch.randn(400, 3, 1, 1)
    turned = recoloured(y, 90)
    assert torch.allclose(turned.sum(1), y.sum(1), atol=1e-5)
    assert torch.allclose(turned.norm(dim=1), y.norm(dim=1), atol=1e-5)
    before, after = (v[:, :, 0, 0] - v.mean(1)[:, 0] for v in (y, turned))
    sine = torch.linalg.cross(before, after, dim=1).sum(1) / 3**0.5
    angle = torch.rad2deg(torch.atan2(sine, (before * after).sum(1)))
    angle = angle[angle.abs() > 0.1]
    assert 160 < len(angle) < 240
    assert -90.1 < angle.min() < -80 and 80 < angle.max() < 90.1
    assert angle.std().item() == pytest.approx(90 / 3**0.5, rel=0.1)


def test_a_poor_camera_is_as_poor_as_it_says():
    """Per channel a gain of 1 +- 0.15 and an offset of 0.1; half of the images lose an edge."""
    torch.manual_seed(0)
    y = torch.zeros(1000, 3, 10, 10)
    y[:, :, :, 5:] = 1.0
    seen = degraded(y)[:, :, 1:-1]
    dark, light = seen[..., 1:4].mean((2, 3)), seen[..., 6:9].mean((2, 3))  # beside the edge
    gain = light - dark
    assert gain.mean().item() == pytest.approx(1, abs=0.02)
    assert gain.std().item() == pytest.approx(0.15, rel=0.1)
    assert dark.mean().abs() < 0.01 and dark.std().item() == pytest.approx(0.1, rel=0.1)
    for v in (gain, dark):
        assert (torch.corrcoef(v.T) - torch.eye(3)).abs().max() < 0.12
    step = (seen[..., 5] - seen[..., 4]).mean(2) / gain  # 1 where it is sharp, 1/3 where it is not
    sharp = step.mean(1) > 2 / 3
    assert 430 < sharp.sum() < 570
    assert step[~sharp].mean().item() == pytest.approx(1 / 3, abs=0.05)
    # Noise of up to 0.1, uniformly: its mean square is 0.1^2 / 3.
    noise = seen[sharp][..., 1:4].var((2, 3)).mean().item()
    assert noise == pytest.approx(0.01 / 3, rel=0.15)


def test_a_poor_camera_moves_nothing(dots):
    y, z = dots
    assert torch.allclose(brightest(degraded(20 * y)), z, atol=1 / 42 + 1e-6)  # blur is 3 px wide


def test_drawn_changes_are_those_that_were_drawn(golden):
    """Of sixteen images of two sizes: which were blurred, how far each moved, which hues turned."""
    figures = facts(augment)
    for seed, side in ((0, 84), (1, 12)):
        y = noise(16, 3, side, side, seed=seed)
        torch.manual_seed(seed)
        worse, (seen, moved), hued = degraded(y), shifted(y, 5), recoloured(y, 70)
        figures[f"moved {side}"] = moved
        for name, images in (("degraded", worse), ("shifted", seen), ("hue", hued)):
            figures[f"{name} {side}"] = [look(image, 5)[1:] for image in images]
        for channel in range(3):
            figures[f"colours {side} {channel}"] = hued[:, channel].mean((1, 2))
    golden(figures)
