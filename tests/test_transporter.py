"""Claims about keypoints, Eq. 6-7, and the detector's known ways to fail."""

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
    noise,
    refusals,
    slopes,
    weights,
)

from lbw_minimal import transporter as tp
from lbw_minimal.images import to_images
from lbw_minimal.training import Checkpoint, InputError, save_state

TRAINING = 40  # iterations of the one training that several claims share, a second for five


def squares(T=240, seed=0):
    """A red and a blue square, 14 px wide, each on a smooth path; true centres (T, 2, 2) in px."""
    rng = np.random.default_rng(seed)
    phase, t = rng.uniform(0, 2 * np.pi, 4), np.arange(T)
    # Frequencies without a common divisor: nothing about one square can be read off the other.
    x_red, y_red = 42 + 26 * np.sin(0.131 * t + phase[0]), 22 + 10 * np.sin(0.171 * t + phase[1])
    x_blue, y_blue = 42 + 26 * np.sin(0.113 * t + phase[2]), 60 + 10 * np.sin(0.097 * t + phase[3])
    red, blue = np.stack([x_red, y_red], 1), np.stack([x_blue, y_blue], 1)
    centres = np.stack([red, blue], 1).round()  # (T, 2, 2)
    frames = np.full((T, 84, 84, 3), 120, np.uint8)
    for frame, pair in zip(frames, centres.astype(int), strict=True):
        for (x, y), colour in zip(pair, [(200, 40, 40), (40, 60, 200)], strict=True):
            frame[y - 7 : y + 7, x - 7 : x + 7] = colour
    return frames, centres - 0.5  # the centre of pixels x - 7 .. x + 6


@pytest.fixture(scope="module")
def trained():
    torch.set_num_threads(1)
    frames, centres = squares()
    model, log = tp.train([frames[:180]], iterations=TRAINING, seed=0, K=4)
    return model, log, tp.detect(model, frames), frames, centres


def follow(z, centres):
    """R^2 (K, squares) of each keypoint's own linear map to each square, the worse of x and y."""
    return np.array(
        [[tp.r2(z[:, [k]], centres[:, s]).min() for s in (0, 1)] for k in range(z.shape[1])]
    )


def test_transport_is_equation_6_by_hand():
    phi_x, phi_y = torch.tensor([[[[2.0, 4.0]]]]), torch.tensor([[[[10.0, 20.0]]]])
    h_x, h_y = torch.tensor([[[[0.5, 0.0]]]]), torch.tensor([[[[0.25, 1.0]]]])
    # (1 - 0.5)(1 - 0.25) 2 + 0.25 * 10 = 3.25 and (1 - 0)(1 - 1) 4 + 1 * 20 = 20
    assert torch.equal(tp.transport(phi_x, phi_y, h_x, h_y), torch.tensor([[[[3.25, 20.0]]]]))


def test_nothing_is_learnt_through_the_source():
    phi_x, phi_y, h_x, h_y = (torch.rand(1, 2, 3, 3, requires_grad=True) for _ in range(4))
    tp.transport(phi_x, phi_y, h_x, h_y).sum().backward()
    assert phi_x.grad is None and h_x.grad is None
    assert phi_y.grad.abs().sum() > 0 and h_y.grad.abs().sum() > 0


def test_gaussian_is_1_at_its_keypoint_and_1_over_e_at_one_sigma():
    sigma = 4 / 21  # two cells
    h = tp.heat_map(torch.zeros(1, 1, 2), sigma)[0, 0]  # the centre is the middle of cell (10, 10)
    assert h[10, 10] == pytest.approx(1)
    assert h[10, 12].item() == pytest.approx(np.exp(-1), abs=1e-5)
    assert h[8, 10].item() == pytest.approx(np.exp(-1), abs=1e-5)


def test_heat_map_has_its_column_from_x_and_its_row_from_y():
    cell = lambda i: (2 * i + 1) / 21 - 1  # noqa: E731
    h = tp.heat_map(torch.tensor([[[cell(17), cell(4)]]]))[0, 0]
    assert divmod(h.argmax().item(), 21) == (4, 17)


def test_heat_map_stays_below_1_where_keypoints_meet():
    h = tp.heat_map(torch.tensor([[[0.0, 0.0], [0.0, 0.0], [0.1, 0.0]]]))
    assert h.min() >= 0 and h.max() <= 1
    # Two equal keypoints of height h merge to 1 - (1 - h)^2.
    one, two = tp.heat_map(torch.zeros(1, 1, 2)), tp.heat_map(torch.zeros(1, 2, 2))
    assert torch.allclose(two, 1 - (1 - one) ** 2, atol=1e-6)


@pytest.mark.parametrize(("row", "column"), [(0, 0), (3, 17), (10, 10), (20, 0), (15, 20)])
def test_soft_argmax_finds_a_sharp_peak_to_within_a_cell(row, column):
    logits = torch.zeros(1, 1, 21, 21)
    logits[0, 0, row, column] = 30.0
    x, y = tp.soft_argmax(logits)[0, 0].tolist()
    assert abs(x - ((2 * column + 1) / 21 - 1)) < 2 / 21
    assert abs(y - ((2 * row + 1) / 21 - 1)) < 2 / 21


def test_soft_argmax_by_hand():
    """Two cells, at -1/2 and 1/2. Three times their logits are ln 2 apart: shares 1/3 and 2/3."""
    logits = torch.tensor([[[[0.0, np.log(2) / 3]]]])
    assert tp.soft_argmax(logits)[0, 0].tolist() == pytest.approx([1 / 6, 0])


def test_x_points_right_and_y_points_down():
    logits = torch.zeros(1, 1, 21, 21)
    logits[0, 0, 2, 18] = 30.0  # top right
    x, y = tp.soft_argmax(logits)[0, 0].tolist()
    assert x > 0.5 and y < -0.5


def test_x_and_y_of_a_keypoint_come_from_the_same_thing():
    """Two peaks, the higher one wins in both; marginals would take x of one and y of the other."""
    logits = torch.zeros(1, 1, 21, 21)
    logits[0, 0, 3:12, 4] = 9.0  # a tall thing on the left has the larger marginal in x
    logits[0, 0, 17, 15] = 14.0
    x, y = tp.soft_argmax(logits)[0, 0]
    assert (x.item(), y.item()) == pytest.approx(
        ((2 * 15 + 1) / 21 - 1, (2 * 17 + 1) / 21 - 1), abs=0.01
    )


def test_identity_is_the_variance_of_the_colour_under_a_keypoint():
    y = torch.zeros(2, 3, 84, 84)
    y[:, 0, :, 42:] = 1.0  # the right half is red
    z = torch.tensor([[[-0.7, 0.0], [0.7, 0.3]], [[0.7, 0.0], [0.7, -0.3]]])
    # The first changes from 0 to 1 in one channel, variance 1/2; the second stays red. Their mean
    # is 1/4.
    assert tp.identity(z, y).item() == pytest.approx(0.25, abs=1e-4)
    # Two keypoints on different things, each of which keeps its colour.
    z = torch.tensor([[[-0.7, 0.0], [0.7, 0.3]], [[-0.7, 0.5], [0.7, -0.3]]])
    assert tp.identity(z, y).item() == pytest.approx(0, abs=1e-4)


def test_loss_is_equation_7_by_hand():
    y_hat, y = torch.zeros(1, 3, 1, 2), torch.ones(1, 3, 1, 2)
    y[..., 1] = 2.0
    assert tp.loss(y_hat, y) == pytest.approx((1 + 4) / 2)
    assert tp.loss(y_hat, y, torch.tensor([[[[1.0, 3.0]]]])) == pytest.approx((1 * 1 + 3 * 4) / 2)


def test_pairs_are_near_each_other_or_drawn_freely_and_every_video_is_target_equally_often():
    source, target = tp._draw_pairs(np.array([1000, 50]), 4000, np.random.default_rng(0))
    same = (source < 1000) == (target < 1000)
    near = same & (np.abs(source - target) <= 20)
    assert source.min() >= 0 and source.max() < 1050 and target.max() < 1050
    assert 0.47 < (target < 1000).mean() < 0.53
    assert 0.5 < near.mean() < 0.6  # some free pairs are near by chance
    gaps = source - target
    assert all((gaps == far).sum() > 20 > (gaps == far + far // 20).sum() for far in (-20, 20))


def test_either_frame_of_two_is_source_as_often_as_the_other():
    """Without the last one as a source a quarter of the sources would be frame 1."""
    source, _ = tp._draw_pairs(np.array([2]), 4000, np.random.default_rng(0))
    assert source.mean() == pytest.approx(0.5, abs=0.03)


def test_some_keypoint_follows_each_moving_square(trained):
    _, _, z, _, centres = trained
    assert (follow(z, centres).max(0) > 0.9).all()


def test_keypoints_do_not_all_sit_on_one_square(trained):
    _, _, z, _, centres = trained
    pixels = (z + 1) * 42 - 0.5
    inside = np.abs(pixels[:, :, None] - centres[:, None]).max(-1) < 10  # (T, K, squares)
    assert (inside.mean(0).max(0) > 0.9).all()


def test_trained_keypoints_leave_the_centre(trained):
    """All but one: with four keypoints for two squares, one may have nothing to do."""
    _, _, z, _, _ = trained
    assert (np.abs(z).max((0, 2)) > 0.2).sum() >= 3


def test_log_tells_how_far_each_keypoint_moves(trained):
    _, log, _, _, _ = trained
    assert log[-1]["step"] == TRAINING and len(log[-1]["keypoint_std"]) == 4
    assert sorted(log[-1]["keypoint_std"])[1] > 0.1


def test_detection_holds_on_noisy_darker_frames(trained):
    model, _, z, frames, centres = trained
    noise = np.random.default_rng(0).normal(0, 6, frames.shape)
    worse = (frames * 0.9 + noise).clip(0, 255).astype(np.uint8)
    assert (
        tp.r2(z, centres.reshape(-1, 4), tp.detect(model, worse), centres.reshape(-1, 4)) > 0.8
    ).all()


def test_detecting_one_frame_or_many_gives_the_same(trained):
    model, _, z, frames, _ = trained
    assert z.dtype == np.float32 and z.shape == (240, 4, 2)
    assert np.allclose(tp.detect(model, frames[100:101])[0], z[100], atol=1e-4)


def test_same_seed_same_model_and_another_seed_another():
    frames, _ = squares(40)
    a, b, c = (
        tp.detect(tp.train([frames], iterations=3, seed=s, K=2)[0], frames[:2]) for s in (0, 0, 1)
    )
    assert np.array_equal(a, b) and not np.array_equal(a, c)


def test_resumed_training_ends_exactly_like_an_unbroken_one(tmp_path):
    frames, _ = squares(40)

    class Killed(Exception):
        pass

    class KilledAfterThree(Checkpoint):
        def save(self, make_state, force=False):
            super().save(make_state, force=True)
            if make_state()["step"] == 3:
                raise Killed

    path = tmp_path / "transporter.ckpt"
    with pytest.raises(Killed):
        tp.train([frames], iterations=6, seed=0, K=2, checkpoint=KilledAfterThree(path))
    resumed, log = tp.train([frames], iterations=6, seed=0, K=2, checkpoint=Checkpoint(path))
    unbroken, log_unbroken = tp.train([frames], iterations=6, seed=0, K=2)
    assert log == log_unbroken
    for a, b in zip(resumed.parameters(), unbroken.parameters(), strict=True):
        assert torch.equal(a, b)


def test_frames_of_another_size_are_refused_in_one_sentence():
    with pytest.raises(InputError, match="84, 84, 3"):
        tp.train([np.zeros((5, 64, 64, 3), np.uint8)], iterations=1, seed=0)


def test_r2_is_1_for_a_linear_map_with_intercept():
    z = np.random.default_rng(0).normal(size=(40, 2, 2))
    true = np.stack([3 * z[:, 0, 0] - z[:, 1, 1] + 40, 7 - 2 * z[:, 0, 1]], 1)
    assert tp.r2(z, true) == pytest.approx([1, 1])
    assert tp.pixel_error(z, true) == pytest.approx([0, 0], abs=1e-9)


def test_r2_by_hand_on_a_held_out_set():
    z, true = np.array([[[0.0]], [[1.0]]]), np.array([[0.0], [1.0]])  # the map is the identity
    z_held, true_held = np.array([[[0.0]], [[2.0]]]), np.array([[0.0], [4.0]])
    # Predicted 0 and 2, true 0 and 4 with mean 2: 1 - 4 / 8; root of the mean square error, (4 /
    # 2)^0.5.
    assert tp.r2(z, true, z_held, true_held) == pytest.approx([0.5])
    assert tp.pixel_error(z, true, z_held, true_held) == pytest.approx([2**0.5])
    # A hundredth of a pixel is judged as well.
    assert tp.r2(z, 0.01 * true, z_held, 0.01 * true_held) == pytest.approx([0.5])


def test_without_a_held_out_set_the_last_quarter_is_held_out():
    """The map is learnt from six of eight frames. In the last two 6 and 8 are 7 and 9, mean 8."""
    z = np.array([0, 1, 2, 3, 4, 5, 6, 8.0])
    true = z + [0, 0, 0, 0, 0, 0, 1, 1]
    assert tp.r2(z[:, None, None], true[:, None]) == pytest.approx([1 - 2 / 2])
    assert tp.pixel_error(z[:, None, None], true[:, None]) == pytest.approx([1])


def test_r2_of_noise_is_below_0_on_average():
    rng = np.random.default_rng(0)
    assert tp.r2(rng.normal(size=(200, 5, 2)), rng.normal(size=(200, 100))).mean() < 0


def test_saved_model_comes_back_with_its_sizes(tmp_path):
    model, images = tp.Transporter(K=3).eval(), torch.rand(2, 3, 84, 84) * 2 - 1
    tp.save(tmp_path / "z.safetensors", model, "push")
    assert torch.equal(
        tp.load(tmp_path / "z.safetensors").keypoints(images), model.keypoints(images)
    )


def test_weights_of_another_task_are_refused(tmp_path):
    tp.save(tmp_path / "z.safetensors", tp.Transporter(), "reach")
    with pytest.raises(InputError, match="reach"):
        tp.load(tmp_path / "z.safetensors", "push")


def test_what_a_moved_view_shows_is_counted_back():
    torch.manual_seed(0)
    model, (x, y) = tp.Transporter(3), torch.rand(2, 4, 3, 84, 84)
    moved = torch.tensor([0.1, -0.2]).expand(4, 1, 2)
    _, z = model(x, y, x, moved=moved)
    assert torch.allclose(z, model.keypoints(x) - moved)


def plain_update(model, x, y, median, early, seen, moved):
    """The weights after a step of rate 1, in the words of the docstrings."""
    z = model.keypoints(seen) - moved
    with torch.no_grad():
        source, h_x = model.phi(x), tp.heat_map(model.keypoints(x), 0.1 + 0.2 * early)
    h_y = tp.heat_map(z, 0.1 + 0.2 * early)
    y_hat = model.refiner((1 - h_x) * (1 - h_y) * source + h_y * model.phi(y))
    weight = 1 + 10 * (y - median).abs().mean(1, keepdim=True)
    loss = (weight * (y_hat - y).square()).mean()
    loss = loss + 0.06 * early * tp.crowding(z, 0.1 + 0.2 * early)
    loss = loss + 0.02 * (1 - early) * tp.identity(z, y)
    grads = torch.autograd.grad(loss, list(model.parameters()))
    norm = torch.stack([g.norm() for g in grads]).norm()
    share = min(1.0, 1 / (norm.item() + 1e-6))
    return [p.detach() - share * g for p, g in zip(model.parameters(), grads, strict=True)]


@pytest.mark.parametrize("early", [1.0, 0.4, 0.0])
def test_an_update_descends_the_three_losses_of_what_the_augmented_frames_show(early, monkeypatch):
    torch.manual_seed(1)
    model, images = tp.Transporter(3), torch.rand(4, 4, 3, 84, 84) * 2 - 1
    x, y, seen, bright = images
    moved, median = torch.tensor([0.1, -0.2]).expand(4, 1, 2), 0.5 * images[0, :1]
    asked = []
    monkeypatch.setattr(tp, "shifted", lambda v, most: asked.append((v, most)) or (seen, moved))
    monkeypatch.setattr(tp, "recoloured", lambda v, most: asked.append((v, most)) or bright)
    monkeypatch.setattr(tp, "degraded", lambda v: asked.append((v, None)) or v + 0.05)
    expected = plain_update(model, x, y, median, early, bright + 0.05, moved)
    spread = model.keypoints(bright + 0.05).std(0).mean(-1).tolist()
    told = tp._update(model, torch.optim.SGD(model.parameters(), 1.0), x, y, median, early, 3, 180)
    assert told["keypoint_std"] == pytest.approx(spread)
    for p, wanted in zip(model.parameters(), expected, strict=True):
        torch.testing.assert_close(p, wanted, atol=1e-5, rtol=1e-4)
    assert [most for _, most in asked] == [3, 180, None]
    assert all(v is given for (v, _), given in zip(asked, (y, seen, bright), strict=True))


def test_without_shift_and_hue_only_the_camera_is_worse(monkeypatch):
    torch.manual_seed(1)
    model, y = tp.Transporter(2), torch.rand(2, 3, 84, 84) * 2 - 1
    asked = []
    monkeypatch.setattr(tp, "degraded", lambda v: asked.append(v) or v)
    for name in ("shifted", "recoloured"):
        monkeypatch.setattr(tp, name, None)
    tp._update(model, torch.optim.SGD(model.parameters(), 1.0), y, y, 0 * y[:1], 0.5, 0, 0)
    assert len(asked) == 1 and asked[0] is y


def test_crowding_is_the_mean_overlap_of_two_different_keypoints():
    z = torch.tensor([[[0.0, 0.0], [0.3, 0.4], [5.0, 5.0]]])  # 0.5 apart, and one far away
    # twice exp(-0.5^2 / (2 * 0.5^2)) of 3^2 pairs
    assert tp.crowding(z, 0.5).item() == pytest.approx(2 * np.exp(-0.5) / 9)
    both = torch.cat([z, 0 * z])  # all three in one place: 6 of 9
    assert tp.crowding(both, 0.5).item() == pytest.approx((2 * np.exp(-0.5) + 6) / 9 / 2)


def test_training_starts_wide_and_ends_narrow_and_learns_along_a_cosine(monkeypatch):
    """Two videos, black and white: the median is that of both, and all pairs are drawn of them."""
    videos = [np.full((n, 84, 84, 3), level, np.uint8) for n, level in ((6, 0), (2, 255))]
    seen = []

    def update(model, optimizer, x, y, median, early, shift, hue):
        assert optimizer.param_groups[0]["betas"] == (0.9, 0.99)
        assert model.training and x.shape == y.shape == (32, 3, 84, 84)
        assert set(y.unique().tolist()) == {-1, 1} and (median == -1).all()
        seen.append((early, optimizer.param_groups[0]["lr"], shift, hue))
        return {}

    monkeypatch.setattr(tp, "_update", update)
    model, log = tp.train(videos, iterations=40, seed=0, K=2, shift=1, hue=2)
    early, rate, shift, hue = map(np.array, zip(*seen, strict=True))
    assert early[[0, 10, 20, 39]] == pytest.approx([1, 0.5, 0, 0])
    assert rate[[0, 9, 20]] == pytest.approx(
        [1e-4, 1e-3 * (1 + np.cos(np.pi * 9 / 40)) / 2, 1e-3], rel=1e-6
    )
    assert 0 < rate[-1] < 1e-5 and set(shift) == {1} and set(hue) == {2}
    assert not model.training and [row["step"] for row in log] == [40]


def test_layers_have_the_sizes_that_the_comments_say():
    model, images = tp.Transporter(4), torch.zeros(2, 3, 84, 84)
    assert model.phi(images).shape == (2, 32, 21, 21)
    assert model.psi(images).shape == (2, 4, 21, 21)
    assert model.refiner(model.phi(images)).shape == (2, 3, 84, 84)


def test_a_cell_of_the_map_is_centred_on_its_four_pixels():
    """Cell i looks as far left of pixel 4 i + 1.5 as right of it."""
    encoder = tp._encoder()
    for layer in encoder.modules():
        if isinstance(layer, torch.nn.Conv2d):
            torch.nn.init.ones_(layer.weight)
        if isinstance(layer, torch.nn.GroupNorm):
            layer.forward = lambda v: v
    v = torch.ones(1, 3, 84, 84, requires_grad=True)
    (seen,) = torch.autograd.grad(encoder(v)[0, 0, 10, 12], v)
    at = torch.arange(84.0)
    rows, columns = seen.sum((0, 1, 3)), seen.sum((0, 1, 2))
    centre = [(w @ at / w.sum()).item() for w in (rows, columns)]
    assert centre == pytest.approx([4 * 10 + 1.5, 4 * 12 + 1.5])


def test_the_background_is_the_median_of_the_whole_of_a_long_video(monkeypatch):
    """Every third of 500 frames; they begin in the dark and are bright in the end."""
    asked, median_frame = [], tp.median_frame
    monkeypatch.setattr(tp, "median_frame", lambda v: asked.append(len(v)) or median_frame(v))
    video, seen = np.zeros((500, 84, 84, 3), np.uint8), []
    video[240:] = 255

    def update(model, optimizer, x, y, median, *rest, **more):
        seen.append(median)
        return {}

    monkeypatch.setattr(tp, "_update", update)
    tp.train([video], iterations=1, seed=0, K=2, shift=1, hue=2)
    assert (seen[0] == 1).all() and asked == [167]


def test_no_frames_have_no_keypoints():
    assert tp.detect(tp.Transporter(3), np.zeros((0, 84, 84, 3), np.uint8)).shape == (0, 3, 2)


def test_a_video_of_one_frame_is_refused_for_nothing_moves_in_it():
    with pytest.raises(InputError, match=r"video 1 is .* two or more frames"):
        tp.train([np.zeros((n, 84, 84, 3), np.uint8) for n in (2, 1)], iterations=1, seed=0, K=2)


# Golden figures -----------------------------------------------------------------------------------


def test_the_constants_of_the_transporter_are_those_of_the_shipped_results(golden):
    golden(facts(tp))


def test_transporters_parts_compute_what_they_computed(golden):
    """Maps that are wider than high, keypoints that meet and that stand beyond the edge."""
    logits, images = noise(2, 3, 5, 8, seed=0), noise(2, 3, 84, 84, seed=2)
    z = 0.6 * noise(2, 3, 2, seed=1)
    z[0, 1] = z[0, 0] + 0.02
    phi_x, phi_y, h_x, h_y = (noise(2, 4, 6, 9, seed=3 + i) for i in range(4))
    golden({
        "keypoints": tp.soft_argmax(logits),
        "map": look(tp.heat_map(z), 30),
        "wide map": look(tp.heat_map(z, 0.3, 9), 30),
        "transported": look(tp.transport(phi_x, phi_y, h_x[:, :1], h_y[:, :1])),
        "loss": [tp.loss(phi_x, phi_y).item(), tp.loss(phi_x, phi_y, h_x[:, :1].abs()).item()],
        "crowding": [tp.crowding(z, sigma).item() for sigma in (0.1, 0.3, 2.0)],
        "identity": tp.identity(z, images).item(),
    })  # fmt: skip


def test_pairs_are_drawn_as_they_were(golden):
    """Exactly: of videos shorter and longer than the widest gap."""
    drawn = [
        tp._draw_pairs(np.array([6, 90, 45]), 120, np.random.default_rng(seed)) for seed in (0, 1)
    ]
    golden({f"{seed}": np.concatenate(pair) for seed, pair in enumerate(drawn)}, rtol=0)


def test_transporters_networks_begin_and_compute_as_they_did(golden):
    torch.manual_seed(0)
    model, (x, y, seen) = tp.Transporter(3), (to_images(blocks(2, i)) for i in (1, 2, 3))
    figures = {"layers": layers(tp.Transporter())}
    figures["begin"] = [p.std().item() for p in model.parameters() if p.ndim > 1]
    asked = {
        "plain": {},
        "all": {"y_seen": seen, "sigma": 0.25, "moved": torch.tensor([0.1, -0.3])},
    }
    for name, more in asked.items():
        y_hat, z = model(x, y, **more)
        figures |= {f"{name} y": look(y_hat), f"{name} z": z}
    golden(figures | {"z": model.eval().keypoints(y)})


@pytest.mark.parametrize("early, scale", [(1.0, 1.0), (0.4, 0.02), (0.0, 1.0)])
def test_a_first_update_of_the_transporter_has_the_gradients_it_had(early, scale, golden):
    """Those of small errors are shorter than the clip, the others are cut off by it."""
    torch.manual_seed(1)
    model, (x, y) = tp.Transporter(3), (scale * to_images(blocks(3, i)) for i in (1, 2))
    with torch.no_grad():
        for p in model.refiner.parameters():
            p.mul_(scale)
    median, optimizer = scale * to_images(blocks(1, 3)), torch.optim.SGD(model.parameters(), 0.01)
    told = tp._update(model, optimizer, x, y, median, early, 3, 120)
    golden({"gradients": slopes(model), **told})


def test_four_steps_of_transporters_training_go_where_they_went(golden, monkeypatch):
    """With shifts and hues, of three videos; what four steps in a row moved tells the rate."""
    monkeypatch.setattr(tp, "LOG_EVERY", 2)
    monkeypatch.setattr(tp, "BATCH", 8)
    kept, bar = Kept(), Bar(monkeypatch, tp)
    videos = [blocks(6, 1), blocks(30, 2, 0, 200), blocks(41, 3, 60, 256)]
    small = dict(iterations=5, seed=3, K=3, shift=4, hue=60)
    model, log = tp.train(videos, **small, checkpoint=kept)
    tp.train(videos, **small, checkpoint=Kept(kept.states[-1]))  # it is done already
    torch.manual_seed(3)
    figures = {"moved": moved(weights(tp.Transporter(3)), model), "forced": kept.forced}
    figures["from the corner"] = tp.detect(model, videos[1][:2]) + 1
    groups = [state["optimizer"]["param_groups"][0] for state in kept.states]
    figures |= {f"adam's {k}": [g[k] for g in groups] for k in ("lr", "eps", "weight_decay")}
    figures |= {
        "bar": bar.told,
        "state": [*kept.states[0]],
        "spread": [row.pop("keypoint_std") for row in log],
    }
    golden(figures | columns(log))


def test_transporters_file_and_refusals_say_what_they_said(golden, tmp_path):
    path, other = tmp_path / "keypoints.safetensors", tmp_path / "other.safetensors"
    tp.save(path, tp.Transporter(3), "push")
    save_state(other, {"kind": "munit", "task": "push"})
    calls = [(path, "reach"), (other, "push"), (tmp_path / "none", "push")]
    shapes = (5, 84, 84), (5, 84, 80, 3), (5, 84, 84, 4), (1, 84, 84, 3)
    films = [np.zeros(shape, np.uint8) for shape in shapes] + [np.zeros((5, 84, 84, 3))]
    told = refusals(tmp_path, *(lambda c=c: tp.load(*c) for c in calls))
    asked = dict(iterations=0, seed=0)
    told += refusals(tmp_path, *(lambda v=v: tp.train([blocks(2, 0), v], **asked) for v in films))
    told += refusals(tmp_path, lambda: tp.train([blocks(2, 0)], **asked, device="tv"))
    figures = {"file": in_file(path), "refusals": told, "any task": tp.load(path).K}
    golden(figures | {"eval": not tp.load(path, "push").training})


def test_a_fit_to_keypoints_is_as_good_as_it_was(golden):
    rng = np.random.default_rng(0)
    z = rng.normal(size=(41, 2, 2))
    true = 20 + 9 * z.reshape(41, 4)[:, [0, 3, 1]] + rng.normal(size=(41, 3)) * [1, 4, 9]
    held = z[::3] + 0.2, true[::3]
    figures = {"r2": [tp.r2(z, true), tp.r2(z, true, *held)]}
    golden(figures | {"pixels": [tp.pixel_error(z, true), tp.pixel_error(z, true, *held)]})


def test_more_frames_than_a_batch_are_detected_as_they_were(golden):
    torch.manual_seed(0)
    z = tp.detect(tp.Transporter(2).eval(), blocks(131, 4))
    golden({"shape": z.shape, "z": z[[0, 63, 64, 127, 128, 130]]})
