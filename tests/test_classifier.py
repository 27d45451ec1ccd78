"""Claims about the goal classifier: what it learns from, how, and what its reward pays."""

from inspect import signature

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

import tasks
from lbw_minimal import classifier, transporter, video
from lbw_minimal.classifier import ClassifierReward, GoalClassifier, goal_frames
from lbw_minimal.training import Checkpoint, InputError, load_state, save_state

ITERATIONS = 200  # of the one training that several claims share


def numbered(T, first=0):
    """A video whose frame i is all first + i."""
    return np.broadcast_to(np.uint8(first + np.arange(T))[:, None, None, None], (T, 84, 84, 3))


def grey(level, T=8):
    return np.full((T, 84, 84, 3), level, np.uint8)


def rank_correlation(x):
    """Spearman's, of x (T,) with time."""
    return np.corrcoef(np.argsort(np.argsort(x)), np.arange(len(x)))[0, 1]


@pytest.fixture(scope="module")
def trained():
    """A classifier of twelve of the human's push films, its log, and the three held out."""
    torch.set_num_threads(1)
    films = [video.read(tasks.VIDEOS / "push" / f"expert_{i:02d}.mp4")[0] for i in range(1, 16)]
    model, log = classifier.train(*goal_frames(films[:12]), iterations=ITERATIONS, seed=0)
    return model, log, films[12:]


def test_goals_are_the_last_tenth_of_each_video_rounded_up():
    positive, negative = goal_frames([numbered(10), numbered(21, 100)])
    assert positive[:, 0, 0, 0].tolist() == [9, 118, 119, 120]
    assert negative[:, 0, 0, 0].tolist() == [*range(9), *range(100, 118)]


def test_mixup_by_hand():
    images = torch.tensor([1.0, 2.0, 4.0]).view(3, 1, 1, 1)
    labels, share = torch.tensor([1.0, 0.0, 0.0]), torch.tensor([0.5, 0.25, 1.0])
    mixed, target = classifier.mixup(images, labels, share, torch.tensor([2, 0, 1]))
    # 0.5 * 1 + 0.5 * 4, 0.25 * 2 + 0.75 * 1, 4; and 0.5 * 1 + 0.5 * 0, 0.25 * 0 + 0.75 * 1, 0
    assert mixed.flatten().tolist() == [2.5, 1.25, 4.0]
    assert target.tolist() == [0.5, 0.75, 0.0]


def test_half_of_a_batch_are_goals_and_they_are_labelled_1():
    goals, others = torch.ones(3, 3, 48, 48), torch.zeros(40, 3, 48, 48)
    images, labels = classifier._draw(goals, others, np.random.default_rng(0))
    assert torch.equal(images[:, 0, 0, 0], labels) and labels.mean() == 0.5
    assert len(labels) == 128


def test_it_learns_at_vices_rate_from_any_mixture_alike(monkeypatch):
    """Shares are uniform: of mean 1/2 and deviation 12^-1/2."""
    rates, shares = [], []
    update, mixup = classifier._update, classifier.mixup

    def told(model, optimizer, *rest):
        rates.append(optimizer.param_groups[0]["lr"])
        return update(model, optimizer, *rest)

    def mixed(images, labels, share, partner):
        shares.append(share)
        return mixup(images, labels, share, partner)

    monkeypatch.setattr(classifier, "_update", told)
    monkeypatch.setattr(classifier, "mixup", mixed)
    classifier.train(grey(200), grey(20), iterations=8, seed=0)
    assert rates == 8 * [1e-4]
    shares = torch.cat(shares)
    assert shares.mean().item() == pytest.approx(0.5, abs=0.04)
    assert shares.std().item() == pytest.approx(12**-0.5, abs=0.02)


def test_small_images_keep_colour_and_place():
    frames = grey(51, 1)
    frames[0, :42, :, 0] = 255  # the upper half is red
    image = classifier.small_images(frames)[0]
    assert image.shape == (3, 48, 48)
    assert torch.allclose(image[0, :22], torch.tensor(1.0), atol=1e-5)
    assert torch.allclose(image[0, 26:], torch.tensor(-0.6), atol=1e-5)
    assert torch.allclose(image[1:], torch.tensor(-0.6), atol=1e-5)


def test_small_images_average_what_is_too_fine_for_them():
    """Stripes a pixel wide are grey; single pixels taken of them would be black and white."""
    frames = grey(0, 1)
    frames[:, :, ::2] = 255
    image = classifier.small_images(frames)[0, :, 4:-4, 4:-4]
    assert image.abs().max() < 0.25


def test_it_tells_held_out_goal_images_from_others(trained):
    model, _, held = trained
    goals, others = (classifier.logits(model, frames) for frames in goal_frames(held))
    assert (goals[:, None] > others).mean() > 0.95  # of all pairs of one and the other


def test_reward_rises_with_the_cube_and_not_before(trained):
    """Spearman's correlation with time along three held-out videos: 1.00 while the cube is pushed,
    in their second half, but 0.6 over the whole, because it falls while the hand approaches."""
    model, _, held = trained
    for film in held:
        logits = classifier.logits(model, film)
        start = len(film) // 2
        assert rank_correlation(logits[start:]) > 0.99
        assert 0.5 < rank_correlation(logits) < 0.8
        assert rank_correlation(logits[start // 4 : start - start // 4]) < -0.8


def test_the_log_tells_a_loss_that_mixing_holds_up_and_accuracy_without_it(trained):
    _, log, _ = trained
    assert [row["step"] for row in log] == [100, 200]
    # Mixed the loss is 1/4 or more on average, and here 0.37; without mixing it is 0.19.
    assert log[-1]["accuracy"] > 0.85 and log[-1]["loss"] > 0.25


def test_what_is_trained_is_frozen(trained, tmp_path):
    model = trained[0]
    classifier.save(tmp_path / "goal.safetensors", model, "push")
    thawed = GoalClassifier()
    ClassifierReward(thawed)
    for frozen in (model, classifier.load(tmp_path / "goal.safetensors", "push"), thawed):
        assert not frozen.training
        assert not any(p.requires_grad for p in frozen.parameters())


def test_reward_is_the_logit_of_the_frame_clipped_to_one():
    model = GoalClassifier()
    with torch.no_grad():
        for p in model.parameters():
            p.zero_()
    for logit, paid in ((-50.0, -1.0), (1.5, 0.5), (50.0, 1.0)):
        with torch.no_grad():
            model.layers[-1].bias.fill_(logit)
        assert ClassifierReward(model, clip=3.0)(grey(0)[0]) == (paid, {"logit": logit})


def test_logits_up_to_ten_are_paid_in_full():
    """Along push's robot videos they stay within 4.4, which the clip must not flatten."""
    model = GoalClassifier()
    with torch.no_grad():
        for p in model.parameters():
            p.zero_()
        model.layers[-1].bias.fill_(7.0)
    assert ClassifierReward(model)(grey(0)[0])[0] == pytest.approx(0.7)


def test_each_step_goes_down_its_own_gradient():
    """A second step on the same mixture has the same gradient, not the sum of both."""
    model, labels = GoalClassifier(), torch.ones(128)
    still = torch.optim.SGD(model.parameters(), 0.0)
    images, seen = torch.rand(128, 3, 48, 48), []
    for _ in range(2):
        classifier._update(model, still, images, labels, np.random.default_rng(0))
        seen.append(model.layers[-1].weight.grad.clone())
    assert torch.allclose(*seen)


def test_layers_but_the_last_are_rectified():
    model, seen = GoalClassifier(), []
    for layer in model.layers:
        if isinstance(layer, torch.nn.Conv2d | torch.nn.Linear):
            layer.register_forward_pre_hook(lambda _, inputs: seen.append(inputs[0].min().item()))
    model(torch.rand(4, 3, 48, 48) * 2 - 1)
    assert len(seen) == 4 and seen[0] < 0 and seen[1:] == [0, 0, 0]


def test_an_image_is_taken_for_a_goal_from_a_logit_of_0_on(monkeypatch):
    class Faint(torch.nn.Linear):
        """A logit of 0.3 for white images, and of -0.3 for black ones."""

        def __init__(self):
            super().__init__(1, 1)

        def forward(self, images):
            return 0.3 * images.mean((1, 2, 3))

    monkeypatch.setattr(classifier, "_update", lambda *_: 0.5)
    monkeypatch.setattr(classifier, "GoalClassifier", Faint)
    _, log = classifier.train(grey(255), grey(0), iterations=1, seed=0)
    assert log[0]["accuracy"] == 1


def test_the_last_step_is_logged_and_kept_whatever_its_number(tmp_path, monkeypatch):
    """A run that is killed before it has written the classifier does not train again."""
    monkeypatch.setattr(classifier, "_update", lambda *_: 0.5)
    path = tmp_path / "classifier"
    few = dict(iterations=7, seed=0, checkpoint=Checkpoint(path))
    assert [row["step"] for row in classifier.train(grey(200), grey(20), **few)[1]] == [7]
    assert load_state(path)["state"]["step"] == 7


def test_a_classifier_learns_for_as_long_as_vices_naive_form():
    assert signature(classifier.train).parameters["iterations"].default == 10_000


def test_same_seed_same_model_and_another_seed_another():
    a, b, c = (
        classifier.logits(
            classifier.train(grey(200), grey(20), iterations=3, seed=s)[0], grey(90, 1)
        )
        for s in (0, 0, 1)
    )
    assert a == b != c


def test_resumed_training_ends_exactly_like_an_unbroken_one(tmp_path):
    class Killed(Exception):
        pass

    class KilledAfterThree(Checkpoint):
        def save(self, make_state, force=False):
            super().save(make_state, force=True)
            if make_state()["step"] == 3:
                raise Killed

    def train(checkpoint=None):
        positive, negative = numbered(8, 100), numbered(30)
        return classifier.train(positive, negative, iterations=6, seed=0, checkpoint=checkpoint)

    path = tmp_path / "classifier.ckpt"
    with pytest.raises(Killed):
        train(KilledAfterThree(path))
    (resumed, log), (unbroken, log_unbroken) = train(Checkpoint(path)), train()
    assert log == log_unbroken
    for a, b in zip(resumed.parameters(), unbroken.parameters(), strict=True):
        assert torch.equal(a, b)


@pytest.mark.parametrize(
    ("videos", "why"),
    [
        ([], "no videos"),
        ([numbered(9), numbered(9)[:, :64]], r"video 1 is \(9, 64, 84, 3\) uint8"),
        ([numbered(9) / 255.0], "video 0 is .* float64"),
        ([numbered(1)], "video 0 has 1 frame; give at least 2"),
    ],
)
def test_videos_without_goal_or_rest_are_refused_in_one_sentence(videos, why):
    with pytest.raises(InputError, match=why):
        goal_frames(videos)


def test_training_without_goal_images_or_others_is_refused():
    with pytest.raises(InputError, match="positive has 0 frames"):
        classifier.train(grey(0, 0), grey(0), iterations=1, seed=0)
    with pytest.raises(InputError, match="negative has 0 frames"):
        classifier.train(grey(0), grey(0, 0), iterations=1, seed=0)


def test_saved_model_comes_back_and_no_other_does(tmp_path):
    model, path = GoalClassifier().eval(), tmp_path / "goal.safetensors"
    classifier.save(path, model, "push")
    assert classifier.logits(classifier.load(path), grey(7)) == pytest.approx(
        classifier.logits(model, grey(7))
    )
    with pytest.raises(InputError, match="weights of the task push, not of reach"):
        classifier.load(path, "reach")
    transporter.save(path, transporter.Transporter(), "push")
    with pytest.raises(InputError, match="not the weights of a goal classifier"):
        classifier.load(path, "push")


# Golden figures -----------------------------------------------------------------------------------


def test_the_constants_of_the_classifier_are_those_of_the_shipped_results(golden):
    golden(facts(classifier))


def test_the_classifier_begins_and_computes_as_it_did(golden):
    torch.manual_seed(0)
    model, images = GoalClassifier(), classifier.small_images(blocks(3, 1))
    beside = dict(memory_format=torch.channels_last)  # in memory: so the layers are faster
    assert images.is_contiguous(**beside) and model.layers[2].weight.is_contiguous(**beside)
    figures = {"layers": layers(model), "logits": model(images), "seen": look(images)}
    figures["begin"] = [p.abs().mean().item() for p in model.parameters()]
    paid = ClassifierReward(model, 0.02)
    figures["paid"] = [paid(frame)[0] for frame in blocks(6, 2)]
    figures["split"] = [len(part) for n in (2, 9, 30, 31) for part in goal_frames([numbered(n)])]
    golden(figures | {"logits of frames": classifier.logits(model, blocks(4, 3))})


def test_a_first_update_of_the_classifier_has_the_gradients_it_had(golden):
    torch.manual_seed(0)
    model, rng = GoalClassifier(), np.random.default_rng(1)
    goals, others = classifier.small_images(blocks(3, 1)), classifier.small_images(blocks(5, 2))
    images, labels = classifier._draw(goals, others, rng)
    figures = {"drawn": images[:, 0, 0, 0]}
    down = torch.optim.SGD(model.parameters(), 0.01)
    figures["loss"] = classifier._update(model, down, images, labels, rng)
    golden(figures | {"gradients": slopes(model)})


def test_three_steps_of_the_classifiers_training_go_where_they_went(golden, monkeypatch):
    monkeypatch.setattr(classifier, "LOG_EVERY", 2)
    kept, bar = Kept(), Bar(monkeypatch, classifier)
    model, log = classifier.train(
        blocks(4, 1), blocks(9, 2), iterations=3, seed=5, checkpoint=kept
    )  # fmt: skip
    done = Kept(kept.states[-1])
    classifier.train(blocks(4, 1), blocks(9, 2), iterations=3, seed=5, checkpoint=done)
    torch.manual_seed(5)
    figures = {
        "bar": bar.told,
        "moved": moved(weights(GoalClassifier()), model),
        "forced": kept.forced,
    }
    for k in ("lr", "betas", "eps", "weight_decay"):
        figures[f"adam's {k}"] = kept.states[-1]["optimizer"]["param_groups"][0][k]
    golden(figures | columns(log) | {"state": [*kept.states[0]]})


def test_the_classifiers_file_and_refusals_say_what_they_said(golden, tmp_path):
    path, other = tmp_path / "classifier.safetensors", tmp_path / "other.safetensors"
    classifier.save(path, GoalClassifier(7), "push")
    save_state(other, {"kind": "munit", "task": "push"})
    calls = [(path, "reach"), (other, "push"), (tmp_path / "none", "push")]
    told = refusals(tmp_path, *(lambda c=c: classifier.load(*c) for c in calls))
    wrong = [], [numbered(9), numbered(9)[:, :64]], [numbered(9) / 1.0], [numbered(2), numbered(1)]
    told += refusals(tmp_path, *(lambda v=v: goal_frames(v) for v in wrong))
    few = (grey(0, 0), grey(0)), (grey(0), grey(0, 0)), (grey(0)[0], grey(0))
    asked = dict(iterations=0, seed=0)
    told += refusals(tmp_path, *(lambda v=v: classifier.train(*v, **asked) for v in few))
    alone = dict(iterations=0, seed=0, device="tv")
    told += refusals(tmp_path, lambda: classifier.train(grey(0), grey(0), **alone))
    least = [len(part) for part in goal_frames([numbered(2)])]
    golden({"file": in_file(path), "refusals": told, "least": least})
