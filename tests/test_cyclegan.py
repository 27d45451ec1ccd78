"""CycleGAN: losses and pool against numbers worked out by hand, and a training that resumes."""

from contextlib import nullcontext

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

from lbw_minimal import cyclegan, gan
from lbw_minimal.cyclegan import CycleGAN, ImagePool, discriminator_losses, generator_losses
from lbw_minimal.images import to_images
from lbw_minimal.munit_networks import MUNIT, Critic
from lbw_minimal.training import Checkpoint, InputError, load_state, save_state


class Stub:
    """G(v) = 2 v + 1 and F(v) = 10 v."""

    def y_of_x(self, x):
        return 2 * x + 1

    def x_of_y(self, y):
        return 10 * y


CRITICS = {"x": lambda image: [image / 100, image / 50], "y": lambda image: [image * 0]}


def image(value):
    return torch.full((1, 1, 2, 2), float(value))


def losses(**medians):
    """x = 1, y = 2; F(y) = 20, G(x) = 3"""
    return generator_losses(Stub(), CRITICS, image(1), image(2), image(20), image(3), **medians)


@pytest.mark.parametrize(
    "name, value",
    [
        ("L_GAN^x", ((0.2 - 1) ** 2 + (0.4 - 1) ** 2) / 2),  # D_X on F(y), the mean over scales
        ("L_GAN^y", 1.0),  # D_Y says 0, should say 1
        ("L_cyc^x", 10 * 3 - 1),  # F(G(x)) against x; G(G(x)) would be 7
        ("L_cyc^y", 2 * 20 + 1 - 2),  # G(F(y)) against y; F(F(y)) would be 200
    ],
)
def test_loss_equals_the_sum_done_by_hand(name, value):
    assert losses()[name].item() == pytest.approx(value)


def test_total_loss_weighs_the_cycle_ten_times():
    names = ["L_GAN^x", "L_GAN^y", "L_cyc^x", "L_cyc^y"]
    L = {name: torch.tensor(7.0**i) for i, name in enumerate(names)}
    assert cyclegan.total_loss(L).item() == 1 + 7 + 10 * (7**2 + 7**3)


def test_critics_lose_nothing_only_on_ones_for_real_and_zeros_for_translated():
    same = {"x": lambda v: [v], "y": lambda v: [v, v]}
    L = discriminator_losses(same, image(1), image(3), image(0), image(0.5))
    assert L["L_D^x"].item() == 0
    assert L["L_D^y"].item() == (3 - 1) ** 2 + 0.5**2


def test_motion_weighs_the_cycle_pixel_by_pixel():
    median = torch.tensor([1.0, 1.0, 1.0, 0.0]).view(1, 1, 2, 2)  # x is 1: one pixel has moved
    heavy = losses(median_x=median)
    assert heavy["L_cyc^x"] == (1 + 4 / 4) * losses()["L_cyc^x"]
    assert heavy["L_cyc^y"] == losses()["L_cyc^y"]


def test_motion_makes_critics_judge_the_arm_not_the_wall():
    made = image(0)
    made[..., 1, 1] = 1.0  # moved there: weight 1 + 20, elsewhere 1
    critics = {d: lambda v: [v] for d in "xy"}  # errors against 0: 1 there, 0 elsewhere
    L = discriminator_losses(critics, image(1), image(1), made, made, median_x=image(0))
    share = (1 + 20) / (4 + 20)
    assert L["L_D^x"].item() == pytest.approx(share) and L["L_D^y"].item() == pytest.approx(1 / 4)


class Dice:
    """A generator whose throws are known."""

    def __init__(self, randoms, integers):
        self.randoms, self.indices = iter(randoms), iter(integers)

    def random(self):
        return next(self.randoms)

    def integers(self, n):
        assert n == cyclegan.POOL
        return next(self.indices)


def numbered(*numbers):
    return torch.tensor(numbers, dtype=torch.float).view(-1, 1, 1, 1)


def test_pool_returns_an_older_image_once_and_keeps_the_new_one(monkeypatch):
    monkeypatch.setattr(cyclegan, "POOL", 2)
    pool = ImagePool(0)
    pool.rng = Dice([0.9, 0.1, 0.2, 0.3], [1, 1, 0])
    assert pool.swap(numbered(0, 1)).flatten().tolist() == [0, 1]  # not full: pool 0, 1
    # 2 is shown itself; 3 takes the place of 1, 4 that of 3: pool 0, 4
    assert pool.swap(numbered(2, 3, 4)).flatten().tolist() == [2, 1, 3]
    assert pool.swap(numbered(5)).flatten().tolist() == [0]
    assert [int(v) for v in pool.images] == [5, 4]


def test_pool_of_fifty_shows_half_of_the_images_late_by_a_hundred_on_average():
    pool, n = ImagePool(0), 10_000
    shown = np.concatenate(
        [pool.swap(numbered(*range(i, i + 4))).flatten() for i in range(0, n, 4)]
    )
    assert shown[:50].tolist() == list(range(50)) and len(pool.images) == 50
    late = (np.arange(n) - shown)[50:]
    assert (late > 0).mean() == pytest.approx(0.5, abs=0.02)
    # One in two is exchanged, for one of fifty: an image waits for 2 * 50 others.
    assert late[late > 0].mean() == pytest.approx(100, abs=6)
    assert len(set(shown[50:])) == n - 50  # none comes back twice


def test_pool_goes_on_as_if_it_had_never_been_in_a_file(tmp_path):
    pool, again = ImagePool(0), ImagePool(1)
    pool.swap(numbered(*range(60)))
    save_state(tmp_path / "pool", pool.state_dict())
    again.load_state_dict(load_state(tmp_path / "pool"))
    new = numbered(*range(60, 120))
    assert torch.equal(again.swap(new), pool.swap(new))


def test_pool_keeps_no_gradient():
    pool = ImagePool(0)
    made = numbered(1, 2).requires_grad_()
    assert not pool.swap(made * 1).requires_grad and not pool.images[0].requires_grad


def gradients(networks):
    return [None if p.grad is None else p.grad.clone() for p in networks.parameters()]


class Spy(torch.optim.SGD):
    """Notes at its step which gradients its own networks and the others' have."""

    def __init__(self, own, others):
        super().__init__(own.parameters(), 0.1)
        self.own, self.others = own, others

    def step(self):
        self.seen = gradients(self.own), gradients(self.others)
        super().step()


def test_a_step_sends_gradients_to_its_own_networks_only():
    torch.manual_seed(0)
    model, critics = CycleGAN(2, blocks=1), nn.ModuleDict({d: Critic(2) for d in "xy"})
    down_G, down_D = Spy(model, critics), Spy(critics, model)
    pools = {d: ImagePool(0) for d in "xy"}
    x, y = torch.rand(2, 2, 3, 84, 84)
    cyclegan._update(model, critics, pools, down_G, down_D, x, y, [None, None])
    assert all(g is None for g in down_G.seen[1])  # the critics', in the generators' step
    assert all(g is not None for g in down_G.seen[0] + down_D.seen[0])
    for before, after in zip(down_G.seen[0], down_D.seen[1], strict=True):
        assert torch.equal(before, after)  # the critics' step added nothing


def test_critics_are_shown_the_pools_images_of_their_own_domain(monkeypatch):
    monkeypatch.setattr(cyclegan, "POOL", 1)
    model, critics = CycleGAN(2, blocks=1), nn.ModuleDict({d: Critic(2) for d in "xy"})
    pools, shown = {}, {}
    for i, d in enumerate("xy"):
        pools[d] = ImagePool(0)
        pools[d].images, pools[d].rng = [torch.full((3, 84, 84), i / 2)], Dice([0.1], [0])
        critics[d].register_forward_pre_hook(lambda _, v, d=d: shown.update({d: v[0]}))  # the last
    spies = Spy(model, critics), Spy(critics, model)
    x, y = torch.rand(2, 1, 3, 84, 84)
    made = model.x_of_y(y), model.y_of_x(x)
    cyclegan._update(model, critics, pools, *spies, x, y, [None, None])
    for d, i, new in zip("xy", (0, 1), made, strict=True):
        assert torch.equal(shown[d], torch.full((1, 3, 84, 84), i / 2))
        kept = pools[d].images[0].float()  # bfloat16 where the processor knows it
        assert torch.allclose(kept, new[0], atol=0.02)


def test_generators_start_as_published():
    torch.manual_seed(0)
    parts = list(CycleGAN(8).named_parameters())
    weights = torch.cat([p.flatten() for name, p in parts if name.endswith("weight")])
    assert weights.std().item() == pytest.approx(0.02, rel=0.01)
    assert all((p == 0).all() for name, p in parts if name.endswith("bias"))


def test_a_generator_has_six_blocks_of_eighty_channels_and_norms_and_rectifies(monkeypatch):
    """What its last layer sees is of mean 0 and deviation 1 in each channel, cut off at 0: of a
    normal one the mean is (2 pi)^-1/2, and half is 0. A training takes as many by default."""
    torch.manual_seed(0)
    model, seen = CycleGAN(), []
    wide = [m for m in model.G.modules() if isinstance(m, nn.Conv2d) and m.in_channels == 80]
    assert len(wide) == 2 * 6 and all(m.out_channels == 80 for m in wide)
    model.G.out.register_forward_pre_hook(lambda _, inputs: seen.append(inputs[0]))
    model.y_of_x(torch.rand(1, 3, 84, 84) * 2 - 1)
    assert seen[0].min() == 0
    assert seen[0].mean().item() == pytest.approx((2 * np.pi) ** -0.5, abs=0.05)
    assert (seen[0] == 0).float().mean().item() == pytest.approx(0.5, abs=0.1)
    monkeypatch.setattr(cyclegan, "_update", lambda *_: {})
    trained, _ = cyclegan.train(*squares(), iterations=1, seed=0)
    assert trained.sizes == model.sizes


def test_a_finished_training_is_in_its_checkpoint(tmp_path, monkeypatch):
    """Or one that is killed before its weights are written would begin at an earlier step."""
    monkeypatch.setattr(cyclegan, "_update", lambda *_: {})
    path = tmp_path / "cyclegan"
    cyclegan.train(*squares(), iterations=3, seed=0, width=2, checkpoint=Checkpoint(path))
    assert load_state(path)["state"]["step"] == 3


def test_translation_is_G_and_does_not_depend_on_the_frames_beside_it():
    torch.manual_seed(0)
    model, frames = (
        CycleGAN(2),
        np.random.default_rng(0).integers(0, 256, (40, 84, 84, 3), np.uint8),
    )
    video = cyclegan.translate(model, frames)
    assert video.shape == frames.shape and video.dtype == np.uint8
    alone = gan.repaint(frames[35:36], model.G, torch.device("cpu"))
    assert np.abs(video[35].astype(int) - alone[0]).max() <= 1  # 1 for rounding


def test_file_carries_sizes_and_weights(tmp_path):
    model = CycleGAN(2, blocks=1)
    cyclegan.save(tmp_path / "cyclegan.safetensors", model, "push")
    loaded = cyclegan.load(tmp_path / "cyclegan.safetensors", "push")
    assert loaded.sizes == model.sizes == dict(width=2, blocks=1)
    for a, b in zip(loaded.parameters(), model.parameters(), strict=True):
        assert torch.equal(a, b.half().float())  # the file holds half precision


def test_weights_of_another_task_are_refused(tmp_path):
    cyclegan.save(tmp_path / "cyclegan.safetensors", CycleGAN(2), "reach")
    with pytest.raises(
        InputError, match=r"cyclegan\.safetensors: weights of the task reach, not of push"
    ):
        cyclegan.load(tmp_path / "cyclegan.safetensors", "push")


def test_file_of_another_network_is_refused(tmp_path):
    gan.save_weights(tmp_path / "other.safetensors", MUNIT(2), "push")
    with pytest.raises(InputError, match=r"other\.safetensors: not the weights of a CycleGAN"):
        cyclegan.load(tmp_path / "other.safetensors", "push")


def test_training_killed_and_resumed_ends_as_if_never_killed(tmp_path, monkeypatch):
    monkeypatch.setattr(cyclegan, "LOG_EVERY", 2)  # killed at step 3: between two rows of the log
    monkeypatch.setattr(cyclegan, "POOL", 4)  # full by then
    monkeypatch.setattr(cyclegan, "Critic", lambda: Critic(8))
    small = dict(iterations=6, seed=1, width=2, batch=2)
    whole, whole_log = cyclegan.train(*squares(), **small)
    path = tmp_path / "cyclegan"
    with pytest.raises(Killed):
        cyclegan.train(*squares(), **small, checkpoint=DiesAfter(path, 3))
    resumed, resumed_log = cyclegan.train(*squares(), **small, checkpoint=Checkpoint(path))
    assert all(
        torch.equal(a, b) for a, b in zip(whole.parameters(), resumed.parameters(), strict=True)
    )
    assert whole_log == resumed_log and [row["step"] for row in resumed_log] == [2, 4, 6]


def test_training_takes_x_from_the_human_and_returns_the_averaged_weights(monkeypatch):
    """At the published rates, which fall over the second half."""
    human, robot = (np.full((4, 84, 84, 3), level, np.uint8) for level in (0, 255))
    seen, rates = [], []

    def update(model, critics, pools, adam_G, adam_D, x, y, medians):
        rates.append([adam.param_groups[0]["lr"] for adam in (adam_G, adam_D)])
        seen.append([v.mean().item() for v in (x, y, *medians)])
        for adam, network in ((adam_G, model), (adam_D, critics)):
            assert adam.param_groups[0]["params"][0] is next(network.parameters())
        return {}

    def follow(average, model, step):
        for p in average.parameters():
            p.data.fill_(step)

    monkeypatch.setattr(cyclegan, "_update", update)
    monkeypatch.setattr(gan, "follow", follow)
    average, _ = cyclegan.train(human, robot, iterations=4, seed=0, width=2, motion=True)
    assert seen == 4 * [[-1, 1, -1, 1]]
    assert rates == [pytest.approx(v) for v in (*3 * [[2e-4, 2e-4]], [1e-4, 1e-4])]
    assert all((p == 4).all() for p in average.parameters()) and not average.training


def test_another_seed_gives_another_model():
    a, b = (
        cyclegan.train(*squares(), iterations=1, seed=seed, width=2, batch=1)[0] for seed in (0, 1)
    )
    assert not torch.equal(a.G.out.weight, b.G.out.weight)


@pytest.mark.parametrize("asked", [False, True])
def test_motion_weights_are_off_unless_asked_for(asked, monkeypatch):
    medians, weigh = [], cyclegan.motion_weight

    def spied(images, median, gain):
        medians.append(median)
        return weigh(images, median, gain)

    monkeypatch.setattr(cyclegan, "motion_weight", spied)
    switch = dict(motion=True) if asked else {}
    cyclegan.train(*squares(), iterations=1, seed=0, width=2, batch=1, **switch)
    assert len(medians) == 8 and all((median is not None) == asked for median in medians)


def test_short_training_halves_the_cycle_loss_and_takes_on_the_robots_colours(monkeypatch):
    monkeypatch.setattr(cyclegan, "LOG_EVERY", 20)
    monkeypatch.setattr(cyclegan, "LEARNING_RATE", 2e-3)  # for 60 steps instead of a thousand
    monkeypatch.setattr(cyclegan, "Critic", lambda: Critic(8))
    human, robot = squares()
    model, log = cyclegan.train(human, robot, iterations=60, seed=0, width=4, batch=1)
    for name in ("L_cyc^x", "L_cyc^y"):
        assert log[-1][name] < 0.5 * log[0][name]
    made = cyclegan.translate(model, human)
    # The robot's wall is 100, the human's 150: four seeds on three processors make it 84 to 109.
    assert np.abs(np.median(made, (0, 1, 2)) - 100).max() < 25


# Golden figures -----------------------------------------------------------------------------------


@pytest.fixture
def exact(monkeypatch):
    """Single precision on every processor; some know another."""
    monkeypatch.setattr(cyclegan, "bfloat16", lambda device: nullcontext())


def test_the_constants_of_cyclegan_are_those_of_the_shipped_results(golden):
    golden(facts(cyclegan))


def test_cyclegans_generators_begin_and_compute_as_they_did(golden):
    torch.manual_seed(0)
    model, x = CycleGAN(3, blocks=2), to_images(blocks(2, 1))
    with torch.no_grad():
        model.G.out.weight.mul_(20)
    figures = {"sizes": str(CycleGAN().sizes), "layers": layers(CycleGAN(4))[:24]}
    figures["begin"] = [p.std().item() for p in model.parameters()]
    golden(figures | {"G": look(model.y_of_x(x)), "F": look(model.x_of_y(x))})


@pytest.mark.parametrize("weighted", [True, False])
def test_a_first_update_of_cyclegan_has_the_losses_and_gradients_it_had(
    weighted, exact, golden, monkeypatch
):
    """With pools that are full of other images, so that some are exchanged."""
    monkeypatch.setattr(cyclegan, "POOL", 3)
    torch.manual_seed(0)
    model, critics = CycleGAN(2, blocks=1), nn.ModuleDict({d: Critic(8) for d in "xy"})
    with torch.no_grad():
        for generator in (model.G, model.F):
            generator.out.weight.mul_(10)
    x, y = to_images(blocks(4, 1, 0, 200)), to_images(blocks(4, 2, 60, 256))
    pools = {d: ImagePool(seed) for d, seed in (("x", 5), ("y", 6))}
    for d, seed in (("x", 7), ("y", 8)):
        pools[d].images = [*to_images(blocks(3, seed))]
    medians = [to_images(blocks(1, seed, 40, 220)) for seed in (3, 4)]
    adams = [torch.optim.SGD(network.parameters(), 0.01) for network in (model, critics)]
    medians = medians if weighted else [None, None]
    told = cyclegan._update(model, critics, pools, *adams, x, y, medians)
    figures = {"generators": slopes(model), "critics": slopes(critics)}
    figures |= {f"pool {d}": [v.mean().item() for v in pools[d].images] for d in "xy"}
    golden(figures | told)


def test_three_steps_of_cyclegans_training_go_where_they_went(exact, golden, monkeypatch):
    monkeypatch.setattr(cyclegan, "LOG_EVERY", 1)
    monkeypatch.setattr(cyclegan, "POOL", 4)
    kept, bar = Kept(), Bar(monkeypatch, cyclegan)
    human, robot = blocks(5, 5, 0, 200), blocks(4, 6, 60, 256)
    small = dict(iterations=3, seed=2, width=2, batch=3, motion=True)
    model, log = cyclegan.train(human, robot, **small, checkpoint=kept)
    cyclegan.train(human, robot, **small, checkpoint=Kept(kept.states[-1]))  # it is done already
    figures = {"bar": bar.told} | columns(log) | {"state": [*kept.states[0]], "forced": kept.forced}
    torch.manual_seed(2)
    networks = {"model": CycleGAN(2), "critics": nn.ModuleDict({d: Critic() for d in "xy"})}
    for name, network in networks.items():
        before = weights(network)
        network.load_state_dict(kept.states[2][name])
        figures[name] = moved(before, network)
    figures["average"] = moved(weights(networks["model"]), model)
    for adam in ("adam_G", "adam_D"):
        groups = [state[adam]["param_groups"][0] for state in kept.states]
        figures |= {f"{adam} {k}": [g[k] for g in groups] for k in ("lr", "eps", "weight_decay")}
    for pool in ("pool_x", "pool_y"):
        figures[pool] = [v.mean().item() for v in kept.states[2][pool]["images"]]
        figures[f"{pool}'s dice"] = str(kept.states[2][pool]["rng"]["state"])
    golden(figures)


def test_cyclegans_file_and_refusals_say_what_they_said(golden, tmp_path):
    path, other = tmp_path / "cyclegan.safetensors", tmp_path / "other.safetensors"
    cyclegan.save(path, CycleGAN(2, 1), "push")
    save_state(other, {"kind": "munit", "task": "push"})
    calls = [(path, "reach"), (other, "push"), (tmp_path / "none", "push")]
    calls = [*(lambda c=c: cyclegan.load(*c) for c in calls)]
    calls.append(lambda: cyclegan.train(*squares(), iterations=0, seed=0, device="tv"))
    golden({
        "file": in_file(path),
        "refusals": refusals(tmp_path, *calls),
        "eval": not cyclegan.load(path, "push").training,
    })  # fmt: skip


def test_cyclegans_translations_look_as_they_looked(golden):
    torch.manual_seed(0)
    model, human, robot = CycleGAN(2, 1), blocks(70, 7, 0, 200), blocks(67, 8, 60, 256)
    with torch.no_grad():
        for generator in (model.G, model.F):
            generator.out.weight.mul_(20)
    figures = {"translated": look(cyclegan.translate(model, human) / 1.0, 0)}
    mean = cyclegan.mean_images(model, human, robot)
    golden(figures | {name: look(image) for name, image in mean.items()})
