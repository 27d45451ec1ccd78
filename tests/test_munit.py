"""MUNIT: the losses against numbers worked out by hand, the parts, and a training that resumes."""

from contextlib import nullcontext
from copy import deepcopy

import numpy as np
import pytest
import torch
from moves import (
    Bar,
    Kept,
    blocks,
    columns,
    facts,
    in_file,
    layers,
    look,
    moved,
    refusals,
    slopes,
    weights,
)
from torch import nn
from toy_videos import DiesAfter, Killed, squares

from lbw_minimal import munit, munit_networks
from lbw_minimal.images import to_images
from lbw_minimal.munit import MUNIT, discriminator_losses, generator_losses, swap
from lbw_minimal.munit_networks import adain
from lbw_minimal.training import Checkpoint, InputError, save_state


class Stub:
    """Networks of numbers: an image v has content 10 v and style v in "x", 10 v + 1 and v + 2 in
    "y"; images are decoded to c + s in "x" and to c + 2 s in "y"."""

    def content(self, image, domain):
        return 10 * image + (domain == "y")

    def style(self, image, domain):
        return image + 2 * (domain == "y")

    def decode(self, c, s, domain):
        return c + (2 * s if domain == "y" else s)


CRITICS = {"x": lambda image: [image / 100, image / 50], "y": lambda image: [image * 0]}


def image(value):
    return torch.full((1, 1, 2, 2), float(value))


@pytest.fixture(scope="module")
def by_hand():
    """x = 1, y = 2; c_x = 10, c_y = 21; s_x = 1, s_y = 4; G_X(c_y, s_x) = 22, G_Y(c_x, s_y) = 18"""
    x, y = image(1), image(2)
    losses = generator_losses(Stub(), CRITICS, x, y, swap(Stub(), x, y))
    return {name: loss.item() for name, loss in losses.items()}


def test_swap_decodes_each_content_with_the_other_domains_style():
    swapped = swap(Stub(), image(1), image(2))
    assert [v.mean().item() for v in swapped] == [10, 21, 1, 4, 22, 18]


@pytest.mark.parametrize(
    "name, value",
    [
        ("L_GAN^x", ((0.22 - 1) ** 2 + (0.44 - 1) ** 2) / 2),  # the mean over scales
        ("L_GAN^y", 1.0),  # D_Y says 0, should say 1
        ("L_rec^x", 10 + 1 - 1),  # G_X(10, 1) against x = 1
        ("L_rec^y", 21 + 2 * 4 - 2),  # G_Y(21, 4) against y = 2
        ("L_rec^c_x", 10 * 18 + 1 - 10),  # E_Y^c(18) against c_x
        ("L_rec^c_y", 10 * 22 - 21),  # E_X^c(22) against c_y
        ("L_rec^s_x", 22 - 1),  # E_X^s(G_X(c_y, s_x)) against s_x
        ("L_rec^s_y", 18 + 2 - 4),  # E_Y^s(G_Y(c_x, s_y)) against s_y
        ("L_cyc^x", 181 + 1 - 1),  # G_X(181, 1) against x
        ("L_cyc^y", 220 + 2 * 4 - 2),  # G_Y(220, 4) against y
    ],
)
def test_loss_equals_the_sum_done_by_hand(by_hand, name, value):
    assert by_hand[name] == pytest.approx(value)


def test_style_loss_compares_styles_of_the_same_domain(by_hand):
    # The known bug takes E_X^s of the Y translation:
    # |E_X^s(18) - s_x| = 17, |E_Y^s(22) - s_y| = 20.
    assert (by_hand["L_rec^s_x"], by_hand["L_rec^s_y"]) == (21, 16)


def test_total_loss_is_equation_5_plus_the_cycle():
    names = ["L_GAN^", "L_rec^", "L_rec^c_", "L_rec^s_", "L_cyc^"]
    L = {name + domain: torch.tensor(7.0**i) for i, name in enumerate(names) for domain in "xy"}
    assert munit.total_loss(L).item() == 2 * (1 + 5 * 7 + 0.5 * 7**2 + 0.5 * 7**3 + 5 * 7**4)


def test_critics_lose_nothing_only_on_ones_for_real_and_zeros_for_translated():
    same = {"x": lambda v: [v], "y": lambda v: [v, v]}
    losses = discriminator_losses(same, image(1), image(3), (None,) * 4 + (image(0), image(0.5)))
    assert losses["L_D^x"].item() == 0
    assert losses["L_D^y"].item() == (3 - 1) ** 2 + 0.5**2


def test_critics_step_sends_no_gradient_to_the_generator():
    made = image(0.5).requires_grad_()
    critic = nn.Conv2d(1, 1, 1)
    critics = {d: lambda v: [critic(v)] for d in "xy"}
    losses = discriminator_losses(critics, image(1), image(1), (None,) * 4 + (made, made))
    sum(losses.values()).backward()
    assert made.grad is None and critic.weight.grad is not None


def test_motion_weighs_image_and_cycle_losses_pixel_by_pixel():
    x, y = image(1), image(2)
    # the weights' mean is 1 + 4 / 4
    median = torch.tensor([1.0, 1.0, 1.0, 0.0]).view(1, 1, 2, 2)
    plain = generator_losses(Stub(), CRITICS, x, y, swap(Stub(), x, y))
    heavy = generator_losses(Stub(), CRITICS, x, y, swap(Stub(), x, y), median_x=median)
    assert heavy["L_rec^x"] == (1 + 4 / 4) * plain["L_rec^x"]
    assert heavy["L_cyc^x"] == (1 + 4 / 4) * plain["L_cyc^x"]
    assert heavy["L_rec^y"] == plain["L_rec^y"]


def test_motion_makes_critics_judge_the_arm_not_the_wall():
    median, made = image(0), image(0)
    made[..., 1, 1] = 1.0  # moved there: weight 1 + 20, elsewhere 1
    # errors against 0 for translated: 1 there, 0 elsewhere
    critics = {d: lambda v: [v] for d in "xy"}
    L = discriminator_losses(
        critics, image(1), image(1), (None,) * 4 + (made, made), median_x=median
    )
    share = (1 + 20) / (4 + 20)
    assert L["L_D^x"].item() == pytest.approx(share) and L["L_D^y"].item() == pytest.approx(1 / 4)


def test_adain_gives_every_channel_the_mean_and_deviation_of_the_style():
    mean, std = torch.randn(2, 5), torch.rand(2, 5) + 0.5
    h = adain(3 * torch.randn(2, 5, 21, 21) + 7, mean, std)
    assert torch.allclose(h.mean((2, 3)), mean, atol=1e-4)
    assert torch.allclose(h.std((2, 3), correction=0), std, atol=1e-4)


def test_content_encoder_is_one_network_when_shared_and_two_when_not():
    shared, apart = MUNIT(2), MUNIT(2, shared_content=False)
    x = torch.randn(1, 3, 84, 84)
    assert torch.equal(shared.content(x, "x"), shared.content(x, "y"))
    assert not torch.equal(apart.content(x, "x"), apart.content(x, "y"))
    one_encoder = sum(p.numel() for p in shared.E_c["x"].parameters())
    count = [sum(p.numel() for p in model.parameters()) for model in (shared, apart)]
    assert count[1] - count[0] == one_encoder


def test_translation_of_a_frame_does_not_depend_on_the_frames_beside_it():
    model, frames = (
        MUNIT(2).eval(),
        np.random.default_rng(0).integers(0, 256, (40, 84, 84, 3), np.uint8),
    )
    s_y = munit.robot_style(model, frames)
    video = munit.translate(model, frames, s_y)
    assert video.shape == frames.shape and video.dtype == np.uint8 and s_y.shape == (8,)
    alone = munit.translate(model, frames[35:36], s_y)
    assert np.abs(video[35].astype(int) - alone[0]).max() <= 1  # one style for all; 1 for rounding


def test_untrained_translation_is_middle_grey_whatever_the_frames(videos):
    torch.manual_seed(0)
    mean = munit.mean_images(MUNIT(8), *videos)
    assert np.abs(mean["y_of_x"] - 127.5).max() < 25 and np.abs(mean["x_of_y"] - 127.5).max() < 25
    assert np.allclose(mean["y"], videos[1].mean(0))


def test_file_carries_sizes_weights_and_style(tmp_path):
    model, style = (
        MUNIT(2, style_dim=3, blocks=1, shared_content=False),
        torch.tensor([1.0, 2.0, 3.0]),
    )
    munit.save(tmp_path / "munit.safetensors", model, style, "push")
    loaded, loaded_style = munit.load(tmp_path / "munit.safetensors", "push")
    assert loaded.sizes == model.sizes and torch.equal(loaded_style, style)
    for a, b in zip(loaded.parameters(), model.parameters(), strict=True):
        assert torch.equal(a, b.half().float())  # the file holds half precision


def test_weights_of_another_task_are_refused(tmp_path):
    munit.save(tmp_path / "munit.safetensors", MUNIT(2), torch.zeros(8), "reach")
    with pytest.raises(
        InputError, match=r"munit\.safetensors: weights of the task reach, not of push"
    ):
        munit.load(tmp_path / "munit.safetensors", "push")


def test_file_of_another_network_is_refused(tmp_path):
    save_state(tmp_path / "other.safetensors", {"kind": "transporter"})
    with pytest.raises(InputError, match=r"other\.safetensors: not the weights of a MUNIT"):
        munit.load(tmp_path / "other.safetensors", "push")


def test_a_shared_encoder_is_written_once(tmp_path):
    sizes = []
    for shared in (True, False):
        model = MUNIT(4, shared_content=shared)
        munit.save(tmp_path / "munit.safetensors", model, torch.zeros(8), "push")
        sizes.append((tmp_path / "munit.safetensors").stat().st_size)
        loaded, _ = munit.load(tmp_path / "munit.safetensors", "push")
        for a, b in zip(loaded.parameters(), model.parameters(), strict=True):
            assert torch.equal(a, b.half().float())
    encoder = sum(p.numel() for p in model.E_c["y"].parameters())
    assert sizes[1] - sizes[0] > 2 * encoder


@pytest.fixture(scope="module")
def videos():
    return squares()


def test_training_killed_and_resumed_ends_as_if_never_killed(videos, tmp_path, monkeypatch):
    monkeypatch.setattr(munit, "LOG_EVERY", 2)  # killed at step 3: between two rows of the log
    small = dict(iterations=5, seed=1, width=2, batch=2)
    whole, whole_log = munit.train(*videos, **small)
    with pytest.raises(Killed):
        munit.train(*videos, **small, checkpoint=DiesAfter(tmp_path / "munit", 3))
    resumed, resumed_log = munit.train(*videos, **small, checkpoint=Checkpoint(tmp_path / "munit"))
    assert all(
        torch.equal(a, b) for a, b in zip(whole.parameters(), resumed.parameters(), strict=True)
    )
    assert whole_log == resumed_log and [row["step"] for row in resumed_log] == [2, 4]


def test_another_seed_gives_another_model(videos):
    a, b = (munit.train(*videos, iterations=1, seed=seed, width=2, batch=1)[0] for seed in (0, 1))
    assert not torch.equal(a.G["x"].out.weight, b.G["x"].out.weight)


def test_short_training_halves_reconstruction_and_cycle_loss(videos, monkeypatch):
    monkeypatch.setattr(munit, "LOG_EVERY", 20)
    _, log = munit.train(*videos, iterations=40, seed=0, width=4, batch=1)
    for name in ("L_rec^x", "L_rec^y", "L_cyc^x", "L_cyc^y"):
        assert log[-1][name] < 0.5 * log[0][name]


def noise(n, seed=0):
    """Images (n, 3, 84, 84) of no domain."""
    return torch.rand(n, 3, 84, 84, generator=torch.Generator().manual_seed(seed)) * 2 - 1


def test_an_update_descends_the_generators_loss_and_then_the_critics_on_the_same_translations(
    monkeypatch,
):
    """Against plain lines, by gradient descent of rate 1 and with two different medians."""
    monkeypatch.setattr(munit, "bfloat16", lambda device: nullcontext())  # some processors know it
    torch.manual_seed(0)
    model, critics = MUNIT(2), nn.ModuleDict({d: munit.Critic(2) for d in "xy"})
    x, y, medians = noise(2, 1), noise(2, 2), (0.5 * noise(1, 3), -0.9 * noise(1, 4).abs())
    swapped = swap(model, x, y)
    loss = munit.total_loss(generator_losses(model, critics, x, y, swapped, *medians))
    of_model = torch.autograd.grad(loss, list(model.parameters()), allow_unused=True)
    loss = sum(discriminator_losses(critics, x, y, swapped, *medians).values())
    of_critics = torch.autograd.grad(loss, list(critics.parameters()))
    expected = [
        p.detach() - (0 if grad is None else grad)
        for network, grads in ((model, of_model), (critics, of_critics))
        for p, grad in zip(network.parameters(), grads, strict=True)
    ]
    rate_1 = [torch.optim.SGD(network.parameters(), 1.0) for network in (model, critics)]
    told = munit._update(model, critics, *rate_1, x, y, medians)
    moved = [*model.parameters(), *critics.parameters()]
    for p, wanted in zip(moved, expected, strict=True):
        torch.testing.assert_close(p, wanted)
    assert len(told) == 12 and told["L_D^x"] + told["L_D^y"] == pytest.approx(loss.item())


def test_training_takes_x_from_the_human_and_y_from_the_robot_and_returns_the_averaged_weights(
    monkeypatch,
):
    human, robot = (np.full((4, 84, 84, 3), level, np.uint8) for level in (0, 255))
    seen, rates = [], []

    def update(model, critics, adam_G, adam_D, x, y, medians):
        rates.append([adam.param_groups[0]["lr"] for adam in (adam_G, adam_D)])
        seen.append([v.mean().item() for v in (x, y, *medians)])
        assert x.shape == y.shape == (3, 3, 84, 84)
        assert {id(p) for p in adam_G.param_groups[0]["params"]} == set(map(id, model.parameters()))
        assert {id(p) for p in adam_D.param_groups[0]["params"]} == set(
            map(id, critics.parameters())
        )
        with torch.no_grad():
            for p in model.parameters():
                p.fill_(11.0)
        return {}

    def follow(average, model, step):
        for p in average.parameters():
            p.data.fill_(step)

    monkeypatch.setattr(munit, "_update", update)
    monkeypatch.setattr(munit.gan, "follow", follow)
    average, _ = munit.train(human, robot, iterations=4, seed=0, width=2, batch=3)
    assert seen == 4 * [[-1, 1, -1, 1]]
    full, falling = [4e-4, 1.2e-3], [2e-4, 6e-4]
    assert rates == [pytest.approx(v) for v in (full, full, full, falling)]
    assert all((p == 4).all() for p in average.parameters()) and not average.training


class Tints:
    """A model whose style is an image's mean grey per domain, and whose images are their style."""

    def __init__(self):
        self.weight = nn.Parameter(torch.zeros(1))

    def parameters(self):
        yield self.weight

    def content(self, image, domain):
        return image if domain == "x" else -image

    def style(self, image, domain):
        return image.mean((1, 2, 3), keepdim=True).flatten(1) + (0.1 if domain == "y" else 0.0)

    def decode(self, c, s, domain):
        return 0.5 * c + s[:, :, None, None] * (1.0 if domain == "x" else 2.0)


def test_a_translation_has_the_videos_content_and_the_other_domains_style():
    """Human grey 25.5 is -0.8, robot 153 is 0.2; styles -0.8 in x and 0.2 + 0.1 in y."""
    human, robot = (np.full((2, 84, 84, 3), level, np.uint8) for level in (25, 153))
    h, r = 25 / 127.5 - 1, 153 / 127.5 - 1
    model = Tints()
    s_y = munit.robot_style(model, robot)
    assert s_y.item() == pytest.approx(r + 0.1)
    two = np.concatenate([robot, human])  # the style is the mean of all frames'
    assert munit.robot_style(model, two).item() == pytest.approx((r + h) / 2 + 0.1)
    many = np.concatenate([human.repeat(50, 0), robot.repeat(50, 0)])  # more than are asked
    assert munit.robot_style(model, many).item() == pytest.approx((r + h) / 2 + 0.1)
    grey = lambda v: round((v + 1) * 127.5)  # noqa: E731
    assert (munit.translate(model, human, s_y) == grey(0.5 * h + 2 * (r + 0.1))).all()
    mean = munit.mean_images(model, human, robot)
    expected = {
        "x": 25,
        "y": 153,
        "x_of_y": grey(-0.5 * r + h),
        "y_of_x": grey(0.5 * h + 2 * r + 0.2),
    }
    for name, value in expected.items():
        assert (mean[name] == value).all(), name


def test_the_style_reaches_every_block_as_means_and_deviations_of_adain():
    """With an mlp that says 0 a block normalises; what it says adds to mean 0 and deviation 1."""
    torch.manual_seed(0)
    decoder, c = MUNIT(2, blocks=2).G["y"], torch.randn(1, 8, 21, 21)
    for p in decoder.mlp.parameters():
        nn.init.zeros_(p)

    def by_hand(said):
        h = c
        for block, (m1, s1, m2, s2) in zip(decoder.blocks, said.reshape(2, 4, 8), strict=True):
            inner = adain(block.first(h), m1[None], 1 + s1[None]).relu()
            h = h + adain(block.second(inner), m2[None], 1 + s2[None])
        return torch.tanh(decoder.out(decoder.up(h).relu()))

    for said in (torch.zeros(64), torch.linspace(-0.5, 0.9, 64)):
        decoder.mlp[-1].bias.data = said
        torch.testing.assert_close(decoder(c, torch.ones(1, 8)), by_hand(said))


def test_a_style_is_the_mean_of_what_the_whole_picture_shows():
    """Not of its most striking place: with another object in it a wall keeps most of its style."""
    torch.manual_seed(0)
    encoder, v = MUNIT(2).E_s["y"], noise(2)
    *convolutions, _, _, linear = encoder
    maps = nn.Sequential(*convolutions)(v)  # (2, 64, h, w)
    torch.testing.assert_close(encoder(v), linear(maps.mean((2, 3))))


def test_codes_images_and_scores_have_the_sizes_that_the_docstrings_say():
    model, critic, v = MUNIT(3, style_dim=5), munit.Critic(4), noise(2)
    assert model.content(v, "x").shape == (2, 12, 21, 21) and model.style(v, "y").shape == (2, 5)
    assert model.decode(model.content(v, "x"), model.style(v, "y"), "y").shape == v.shape
    assert [score.shape for score in critic(v)] == [(2, 1, 10, 10), (2, 1, 5, 5)]


def test_a_critics_scores_look_at_patches_of_22_and_44_pixels():
    critic, v = munit.Critic(2), noise(1).requires_grad_()
    for scale, size in ((0, 22), (1, 44)):
        score = critic(v)[scale]
        h = score.shape[-1] // 2
        (seen,) = torch.autograd.grad(score[0, 0, h, h], v)
        rows = seen.abs().sum((0, 1, 3)).nonzero()
        assert rows.max() - rows.min() + 1 == size


def test_the_critics_leak_a_fifth_as_published():
    slopes = [m.negative_slope for m in munit.Critic().modules() if isinstance(m, nn.LeakyReLU)]
    assert slopes == 6 * [0.2]


# Golden figures -----------------------------------------------------------------------------------


@pytest.fixture
def exact(monkeypatch):
    """Single precision on every processor; some know another."""
    monkeypatch.setattr(munit, "bfloat16", lambda device: nullcontext())


def domains(n):
    """So many images of a dark domain and of a bright one, and two medians."""
    x, y = to_images(blocks(n, 1, 0, 200)), to_images(blocks(n, 2, 60, 256))
    return x, y, [to_images(blocks(1, seed, 40, 220)) for seed in (3, 4)]


def test_the_constants_of_munit_are_those_of_the_shipped_results(golden):
    golden(facts(munit) | facts(munit_networks))


def test_munits_networks_begin_and_compute_as_for_the_shipped_results(golden):
    torch.manual_seed(0)
    model, critic = MUNIT(3, style_dim=5), munit.Critic()
    x, y, _ = domains(2)
    figures = {"sizes": str(MUNIT().sizes), "layers": layers(MUNIT()), "critic": layers(critic)}
    figures["begin"] = [p.std().item() for p in model.parameters() if p.ndim > 1]
    apart = MUNIT(3, style_dim=5, blocks=1, shared_content=False)
    figures["numbers in each"] = [p.numel() for p in apart.parameters()]
    for domain, image in (("x", x), ("y", y)):
        c, s = model.content(image, domain), model.style(image, domain)
        figures |= {f"content {domain}": look(c), f"style {domain}": look(s, 10)}
        figures[f"decoded {domain}"] = look(model.decode(c, 9 * s, domain))
    figures |= {f"scores {i}": look(score) for i, score in enumerate(critic(x))}
    golden(figures)


@pytest.mark.parametrize("weighted", [True, False])
def test_a_first_update_of_munit_has_the_losses_and_gradients_it_had(weighted, exact, golden):
    torch.manual_seed(0)
    model, critics = MUNIT(2), nn.ModuleDict({d: munit.Critic(8) for d in "xy"})
    x, y, medians = domains(2)
    with torch.no_grad():
        for decoder in model.G.values():
            decoder.out.weight.mul_(10)  # or styles would hardly show
    adams = [torch.optim.SGD(network.parameters(), 0.01) for network in (model, critics)]
    old = [p.clone() for p in model.parameters()]
    told = munit._update(model, critics, *adams, x, y, medians if weighted else [None, None])
    figures = {"generators": slopes(model), "critics": slopes(critics)}
    change = [(p - q).norm().item() for p, q in zip(old, model.parameters(), strict=True)]
    golden(figures | told | {"change": sum(change)})


def test_three_steps_of_munits_training_go_where_they_went(exact, golden, monkeypatch):
    """Losses, how far off the mean images are, and how far all weights have moved in the end."""
    monkeypatch.setattr(munit, "LOG_EVERY", 1)
    kept, bar = Kept(), Bar(monkeypatch, munit)
    films = blocks(5, 5, 0, 200), blocks(4, 6, 60, 256)
    small = dict(iterations=3, seed=2, width=2, batch=3)
    model, log = munit.train(*films, **small, checkpoint=kept)
    munit.train(*films, **small, checkpoint=Kept(kept.states[-1]))  # it is done already
    figures = {"bar": bar.told} | columns(log) | {"state": [*kept.states[0]], "forced": kept.forced}
    torch.manual_seed(2)
    networks = {"model": MUNIT(2), "critics": nn.ModuleDict({d: munit.Critic() for d in "xy"})}
    networks["average"] = deepcopy(networks["model"])
    for name, network in networks.items():
        before = weights(network)
        network.load_state_dict(kept.states[2][name])
        figures[name] = moved(before, network)
    for adam in ("adam_G", "adam_D"):
        groups = [state[adam]["param_groups"][0] for state in kept.states]
        figures |= {f"{adam} {k}": [g[k] for g in groups] for k in ("lr", "eps", "weight_decay")}
    golden(figures | {"returned": moved(weights(model), networks["average"])})


def test_munits_file_and_refusals_say_what_they_said(golden, tmp_path):
    path, other = tmp_path / "munit.safetensors", tmp_path / "other.safetensors"
    munit.save(path, MUNIT(2), torch.ones(8), "push")
    save_state(other, {"kind": "transporter", "task": "push"})
    calls = [(path, "reach"), (other, "push"), (tmp_path / "none", "push")]
    calls = [*(lambda c=c: munit.load(*c) for c in calls)]
    calls.append(lambda: munit.train(*squares(), iterations=0, seed=0, device="tv"))
    golden({
        "file": in_file(path),
        "refusals": refusals(tmp_path, *calls),
        "eval": not munit.load(path, "push")[0].training,
    })  # fmt: skip


def test_munits_translations_look_as_they_looked(golden):
    """More frames than any one batch, or any mean, takes."""
    torch.manual_seed(0)
    model, human, robot = MUNIT(2), blocks(70, 7, 0, 200), blocks(67, 8, 60, 256)
    with torch.no_grad():
        for decoder in model.G.values():
            decoder.out.weight.mul_(20)
        for encoder in model.E_s.values():
            encoder[-1].weight.mul_(200)  # one frame's style shows against the mean's
    style = munit.robot_style(model, robot)
    figures = {
        "style": style,
        "learns": style.requires_grad,
        "translated": look(munit.translate(model, human, style) / 1.0, 0),
    }
    mean = munit.mean_images(model, human, robot)
    golden(figures | {name: look(image) for name, image in mean.items()})
