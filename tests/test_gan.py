"""What both translations share; each part's losses stand in test_munit and test_cyclegan."""

import numpy as np
import pytest
import torch
from moves import blocks, facts, look, noise
from torch import nn

from lbw_minimal import cyclegan, gan, munit
from lbw_minimal.munit_networks import bfloat16
from lbw_minimal.training import Checkpoint


def test_learning_rate_holds_for_half_the_training_and_then_falls_to_nothing():
    adam, rates = gan.adam(nn.Linear(1, 1), 1.0), []
    for done in (0, 0.5, 0.75, 1):
        gan.set_rate(adam, 8.0, done)
        rates.append(adam.param_groups[0]["lr"])
    assert rates == [8, 8, 4, 0]


def test_scores_of_half_the_digits_are_judged_with_all():
    """0.30078125 has eight binary digits, and the square of what is missing to 1 has sixteen."""
    score = torch.full((1, 1, 5, 5), 0.30078125, dtype=torch.bfloat16)
    loss = gan.least_squares([score], 1.0, torch.ones(1, 1, 84, 84))
    assert loss.item() == pytest.approx(0.69921875**2, rel=1e-6)


def test_nothing_is_learnt_from_repainting():
    """A graph of a whole video would take gigabytes."""
    learns = []
    gan.repaint(blocks(2, 0), lambda v: learns.append(torch.is_grad_enabled()) or v, "cpu")
    assert learns == [False]


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


@pytest.mark.parametrize("translation", [munit, cyclegan])
def test_a_row_of_the_log_has_the_means_of_the_steps_since_the_row_before(translation, monkeypatch):
    """Losses 1, 2, 3, 4, a row every two steps, and the translations of the averaged weights."""
    losses, asked = iter([1.0, 2.0, 3.0, 4.0]), []
    frames = [np.full((2, 84, 84, 3), level, np.uint8) for level in (10, 20)]

    def mean_images(model, human, robot):
        asked.append((model, human[0, 0, 0, 0], robot[0, 0, 0, 0]))
        return {name: np.zeros(1) for name in ("x", "y", "x_of_y", "y_of_x")}

    monkeypatch.setattr(translation, "LOG_EVERY", 2)
    monkeypatch.setattr(translation, "_update", lambda *_: {"L_cyc^y": next(losses)})
    monkeypatch.setattr(translation, "mean_images", mean_images)
    average, log = translation.train(*frames, iterations=4, seed=0, width=2)
    assert [(row["step"], row["L_cyc^y"]) for row in log] == [(2, 1.5), (4, 3.5)]
    assert asked == 2 * [(average, 10, 20)] and log[0]["mean_image^x"] == 0


def test_cyclegans_mean_images_are_named_by_what_they_are_made_of(monkeypatch):
    """G adds 1 to human frames, F takes 1 from the robot's; 32 frames stand for all."""
    seen = []

    def repaint(frames, network, device):
        seen.append(len(frames))
        return frames + np.uint8(1) if network == "G" else frames - np.uint8(1)

    class Model:
        y_of_x, x_of_y = "G", "F"

        def parameters(self):
            yield torch.zeros(1)

    monkeypatch.setattr(gan, "repaint", repaint)
    human = np.repeat(np.array([10, 30], np.uint8), 84 * 84 * 3 * 50).reshape(100, 84, 84, 3)
    robot = np.full((5, 84, 84, 3), 90, np.uint8)
    mean = cyclegan.mean_images(Model(), human, robot)
    assert {name: image.mean() for name, image in mean.items()} == {
        "x": 20, "x_of_y": 89, "y": 90, "y_of_x": 21,
    }  # fmt: skip
    assert sorted(seen) == [5, 32] and mean["x"].shape == (84, 84, 3)


@pytest.mark.parametrize("translation", [munit, cyclegan])
def test_each_loss_is_weighted_by_its_own_image_and_its_domains_median(translation, monkeypatch):
    """x, y, x_of_y, y_of_x are 1, 2, 3, 4 grey; the medians 10 and 20: 10.3 is x_of_y with X's."""
    asked = {}

    def weight(image, median, gain):
        found = median.mean().item() + image.mean().item() / 10
        asked[round(found, 1)] = gain
        return torch.tensor(found)

    monkeypatch.setattr(translation, "motion_weight", weight)
    monkeypatch.setattr(translation, "l1", lambda a, b, weight=0.0: weight)
    monkeypatch.setattr(translation, "least_squares", lambda scores, target, weight: weight)
    monkeypatch.setattr(gan, "critic_loss", lambda D, real, made, w_real, w_made: (w_real, w_made))
    x, y, x_of_y, y_of_x = (torch.full((1, 3, 2, 2), float(n)) for n in (1, 2, 3, 4))
    medians = torch.full((1, 3, 2, 2), 10.0), torch.full((1, 3, 2, 2), 20.0)

    class Model:
        """Networks that return what they are given."""

        content = style = decode = staticmethod(lambda image, *_: image)
        x_of_y = y_of_x = staticmethod(lambda image: image)

    critics = {domain: lambda image: [image] for domain in "xy"}
    made = (x_of_y, y_of_x) if translation is cyclegan else ((x, y, x, y, x_of_y, y_of_x),)
    L = translation.generator_losses(Model(), critics, x, y, *made, *medians)
    named = {"L_GAN^x": 10.3, "L_GAN^y": 20.4, "L_cyc^x": 10.1, "L_cyc^y": 20.2}
    named |= {"L_rec^x": 10.1, "L_rec^y": 20.2} if translation is munit else {}
    assert {name: float(w) for name, w in L.items() if w} == pytest.approx(named)
    assert asked == {10.1: 4, 20.2: 4, 10.3: 20, 20.4: 20}
    L = translation.discriminator_losses(critics, x, y, *made, *medians)
    for name, weights in {"L_D^x": (10.1, 10.3), "L_D^y": (20.2, 20.4)}.items():
        assert [w.item() for w in L[name]] == pytest.approx(weights)
    assert asked == {10.1: 20, 20.2: 20, 10.3: 20, 20.4: 20}


def film(dark, bright):
    """That many black frames, then that many white ones."""
    return np.repeat(np.uint8([0, 255]), (dark, bright))[:, None, None, None] * np.ones(
        (84, 84, 3), np.uint8
    )


def test_the_median_image_is_that_of_all_frames():
    assert (gan.median_image(film(120, 121), torch.device("cpu")) == 1).all()


@pytest.mark.parametrize("translation", [munit, cyclegan])
def test_a_domains_mean_image_is_of_the_whole_video_not_of_how_it_begins(translation):
    model = translation.MUNIT(2) if translation is munit else translation.CycleGAN(2)
    mean = translation.mean_images(model, film(40, 40), film(30, 90))
    assert np.allclose(mean["x"], 255 / 2) and np.allclose(mean["y"], 255 * 3 / 4)


@pytest.mark.parametrize("translation", [munit, cyclegan])
def test_a_finished_training_is_kept_and_not_done_again(translation, tmp_path, monkeypatch):
    steps = []
    monkeypatch.setattr(translation, "_update", lambda *args: steps.append(1) or {})
    for _ in range(2):
        kept = Checkpoint(tmp_path / "kept", seconds=1e9)
        translation.train(film(1, 1), film(1, 1), iterations=3, seed=0, width=2, checkpoint=kept)
    assert len(steps) == 3


@pytest.mark.parametrize(
    ("device", "knows", "used"), [("cpu", True, True), ("cpu", False, False), ("cuda", False, True)]
)
def test_a_processor_computes_in_bfloat16_if_it_knows_it_and_a_gpu_always(
    device, knows, used, monkeypatch
):
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"avx512_bf16": knows})
    monkeypatch.setattr(torch, "autocast", lambda kind, dtype, enabled: (kind, dtype, enabled))
    assert bfloat16(torch.device(device)) == (device, torch.bfloat16, used)


def test_the_constants_of_translations_are_those_of_the_shipped_results(golden):
    golden(facts(gan))


def test_what_translations_share_computes_what_it_computed(golden):
    """Weighted errors of two scales that are not square, draws, medians, rates and averages."""
    rng, cpu = np.random.default_rng(1), torch.device("cpu")
    a, b, weight = (
        noise(2, 3, 84, 84, seed=0),
        noise(2, 3, 84, 84, seed=1),
        torch.ones(2, 1, 84, 84),
    )
    weight[:, :, :, 50:], weight[0, :, :9] = 5.0, 21.0
    scores = [noise(2, 1, 10, 10, seed=2), noise(2, 1, 5, 5, seed=3)]
    figures = {"l1": [gan.l1(a, b).item(), gan.l1(a, b, weight).item()]}
    figures["squares"] = [gan.least_squares(scores, t, weight).item() for t in (0.0, 1.0)]
    of_halves = gan.l1(a.bfloat16(), b.bfloat16())
    figures |= {"of bfloat16": of_halves.item(), "in": str(of_halves.dtype)}
    D = lambda v: [s + v.mean() for s in scores]  # noqa: E731
    figures["critic"] = gan.critic_loss(D, a + 1, b - 2, weight, weight.flip(3)).item()
    frames = blocks(7, 4)
    figures["drawn"] = [look(gan.draw(frames, 9, rng, cpu)[:, :, 5, 5], 27) for _ in range(2)]
    figures["median"] = look(gan.median_image(frames[:6], cpu)[:, :, ::14, ::14], 20)
    adam, average, model = gan.adam(nn.Linear(2, 2), 3.0), nn.Linear(1, 2), nn.Linear(1, 2)
    figures["rates"] = []
    for done in (0.0, 0.4, 0.5, 0.6, 0.99):
        gan.set_rate(adam, 3.0, done)
        figures["rates"].append(adam.param_groups[0]["lr"])
    for network, value in ((average, 0.0), (model, 1.0)):
        for p in network.parameters():
            nn.init.constant_(p, value)
    figures["averages"] = []
    for step in (1, 2, 60, 1989, 1991, 9000):
        gan.follow(average, model, step)
        figures["averages"].append(1 - average.bias[0].item())
    options = {k: adam.param_groups[0][k] for k in ("betas", "eps", "weight_decay", "amsgrad")}
    repainted = gan.repaint(blocks(65, 5), lambda v: v.flip(3) / 2, cpu)
    figures |= {"adam": str(options), "repainted": look(repainted[:, 5::14, 5::14])}
    golden(figures)
