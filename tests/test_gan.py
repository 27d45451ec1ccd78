"""What both translations share; each part's losses stand in test_munit and test_cyclegan."""

import numpy as np
import pytest
import torch
from torch import nn

from lbw_minimal import cyclegan, gan, munit


def test_learning_rate_holds_for_half_the_training_and_then_falls_to_nothing():
    adam, rates = gan.adam(nn.Linear(1, 1), 1.0), []
    for done in (0, 0.5, 0.75, 1):
        gan.set_rate(adam, 8.0, done)
        rates.append(adam.param_groups[0]["lr"])
    assert rates == [8, 8, 4, 0]


def test_adams_memory_is_the_publications():
    assert gan.adam(nn.Linear(1, 1), 1.0).param_groups[0]["betas"] == (0.5, 0.999)


@pytest.mark.parametrize("translation", [munit, cyclegan])
def test_a_step_takes_four_images_of_each_domain(translation, monkeypatch):
    shapes, frames = [], np.zeros((2, 84, 84, 3), np.uint8)

    def update(*args):
        shapes.extend(v.shape for v in args if torch.is_tensor(v))
        return {}

    monkeypatch.setattr(translation, "_update", update)
    translation.train(frames, frames, iterations=1, seed=0, width=2)
    assert shapes == 2 * [(4, 3, 84, 84)]


def test_averaged_weights_remember_little_at_first_and_two_hundred_steps_later():
    average, model = nn.Linear(1, 1), nn.Linear(1, 1)
    for step, share in ((1, 10 / 11), (10, 1 / 2), (100_000, 1 / 200)):
        nn.init.zeros_(average.weight)
        nn.init.ones_(model.weight)
        gan.follow(average, model, step)
        assert average.weight.item() == pytest.approx(share)


def test_descend_forgets_the_gradient_of_the_step_before():
    layer = nn.Linear(1, 1, bias=False)
    down = torch.optim.SGD(layer.parameters(), 1.0)
    before = layer.weight.item()
    for _ in range(2):
        gan.descend(down, 3 * layer.weight.sum())
    assert layer.weight.item() == pytest.approx(before - 6)


def test_log_tells_each_translation_from_the_domain_it_is_made_for():
    mean = {name: np.full((2, 2, 3), v) for name, v in dict(x=1, y=5, x_of_y=3, y_of_x=9).items()}
    row = gan.log_row(7, {"L": 6.0}, 2, mean)
    assert row == {"step": 7, "L": 3, "mean_image^x": 2, "mean_image^y": 4}


@pytest.mark.parametrize("translation", [munit, cyclegan])
def test_motion_weights_can_be_switched_off_in_each_translation(translation, monkeypatch):
    """As notebook 4 does it: by the constants that the file of the translation names."""
    monkeypatch.setattr(translation, "MOTION_GAN", 0.0)
    real, made = torch.ones(1, 1, 2, 2), torch.zeros(1, 1, 2, 2)
    made[..., 1, 1] = 1.0
    made = (None,) * 4 + (made, made) if translation is munit else made
    made = (made,) if translation is munit else (made, made)
    critics = {domain: lambda v: [v] for domain in "xy"}
    L = translation.discriminator_losses(critics, real, real, *made, median_x=0 * real)
    assert L["L_D^x"].item() == pytest.approx(1 / 4)  # with the weights (1 + 20) / (4 + 20)
