"""What drawings promise whatever their numbers are: whole arms, hands that hang together, rooms of
possible colours, doors, handles and passers-by."""

import numpy as np
import pytest

from lbw_minimal.clips import drawings
from lbw_minimal.clips import drawn_shapes as draw

T = 60
WHITE, GREY, RED = np.full(3, 255.0), np.full(3, 100.0), np.array([200.0, 0, 0])


def person(**of):
    """A red arm without a sleeve, with a grey glove; `of` says what else it has."""
    someone = draw.Person(np.random.default_rng(0), reach=50)
    plain = dict(
        hand=draw.HANDS["pointing"], length=12.0, flip=1, down=False, bend=0.0, sway=0.0, seen=1.0,
        skin=RED, cloth=WHITE, glove=GREY, wrist=2.0, elbow=3.0, sleeve=-1.0, loose=1.5,
        knit=np.ones((84, 84, 1), np.float32), elbow_side=1, bones=np.array([30.0, 30.0]),
        torso=None, light=np.zeros(2), tool=0.0, watch=None, stripes=0,
    )  # fmt: skip
    vars(someone).update(plain | of)
    return someone


def story(kind, seed):
    return drawings._story(np.random.default_rng(seed), kind, T)


@pytest.mark.parametrize("hand", draw.HANDS.values(), ids=draw.HANDS)
def test_fingers_grow_out_of_the_hand_and_no_two_from_one_place(hand):
    """A finger begins within its radius of the palm's stick, or of another finger."""
    sticks = np.array(hand)
    for i, (u, v, *_, r, _) in enumerate(sticks[1:], 1):
        others = np.delete(sticks, i, axis=0)
        near = []
        for u_a, v_a, u_b, v_b, r_a, r_b in others:
            t = np.linspace(0, 1, 50)[:, None]
            along = (1 - t) * (u_a, v_a) + t * (u_b, v_b)
            radius = (1 - t[:, 0]) * r_a + t[:, 0] * r_b
            near.append((np.linalg.norm(along - (u, v), axis=1) - radius).min())
        assert min(near) < r
    begins = sticks[1:, :2]
    apart = np.linalg.norm(begins[:, None] - begins[None], axis=2) + np.eye(len(begins))
    assert apart.min() > 0.05


def test_an_arm_is_whole_from_its_shoulder_to_its_tip():
    layer = person().draw(np.array([80.0, 40]), np.array([8.0, 40]), 0.0)
    assert (layer[40, 8:79, 3] == 255).all()


def test_cloth_is_darker_where_its_surface_is():
    """A surface of a half: the arm's colours are half as bright, the hand's as they were."""
    half = np.full((84, 84, 1), 0.5, np.float32)
    plain, worn = (
        person(**knit).draw(np.array([80.0, 40]), np.array([8.0, 40]), 0.0)
        for knit in ({}, {"knit": half})
    )
    assert worn[40, 30, 0] == plain[40, 30, 0] // 2 == 100
    assert worn[40, 72, 0] == plain[40, 72, 0] and (worn[..., 3] == plain[..., 3]).all()


def test_a_torso_begins_beside_the_shoulder():
    """Its upper end is round, 8 pixels about a place that is 0.8 of its height further down."""
    torso = dict(torso=np.array([8.0, 30.0]), bones=np.array([25.0, 25.0]))
    layer = person(**torso).draw(np.array([75.0, 20]), np.array([30.0, 20]), 0.0)
    rows = np.flatnonzero((layer[..., 2] > 180).any(1))
    assert rows[0] == pytest.approx(20 + 0.8 * 30 - 8, abs=1.5)


def test_both_ends_of_a_limb_are_lit_from_the_same_side():
    """The lit part is moved by 0.4 of the radius at either end: 4 pixels up, and 2."""
    layer = draw.empty()
    someone = person(light=np.array([0.0, -0.4]))
    someone._limb(layer, np.array([20.0, 40]), np.array([60.0, 40]), 10.0, 5.0, WHITE)
    rows = np.arange(84) + 0.5
    for x, up in ((20, 4), (59, 2)):
        lit = layer[:, x, 0] > 250
        assert rows[lit].mean() == pytest.approx(40 - up, abs=0.8)


def test_a_cans_foot_is_in_its_own_shade():
    layer = draw.empty()
    draw.thing(layer, "can", np.array([40.0, 50]), np.array([10.0, 20]), (GREY, RED))
    assert layer[68, 40, 0] == 85


class Striped:
    """Chance that makes a surface of stripes alone: at an angle of 30 degrees, 10 pixels apart."""

    def normal(self, mean, deviation, size):
        return np.zeros(size)

    def random(self):
        return 0.1

    def uniform(self, low, high):
        return np.pi / 6 if high < 4 else 10.0


def test_stripes_are_straight_and_as_far_apart_as_they_say():
    """Up and down they are 10 / sin 30 = 20 pixels apart, across 10 / cos 30 = 11.5."""
    pattern = draw.a_surface(Striped(), 0.5)[..., 0]
    assert (pattern[20:] == pattern[:-20]).mean() > 0.95
    assert (pattern[10:] == pattern[:-10]).mean() < 0.1
    changes = (np.diff(pattern[40]) != 0).sum()
    assert changes == pytest.approx(2 * 83 / 11.5, abs=1.1)


def test_a_hand_that_comes_from_outside_comes_from_where_its_shoulder_is():
    """It leans along with all of its way. It has come by 0.6 to 1.0 of its arm when it touches."""
    came = 0
    for seed in range(60):
        told = story("push", seed)
        first = int(np.argmax(np.linalg.norm(told.object - told.object[0], axis=1) > 0.3))
        if not np.allclose(told.tip - told.tip[0], told.shoulder - told.shoulder[0]):
            continue
        touch = told.tip[first] - told.object[first] + told.object[0]
        way, arm = touch - told.tip[0], told.tip[0] - told.shoulder[0]
        if np.linalg.norm(way) < 1e-3 * np.linalg.norm(arm):
            continue  # the clip begins with the touch
        came += 1
        cosine = way @ arm / np.linalg.norm(way) / np.linalg.norm(arm)
        share = np.linalg.norm(way) / np.linalg.norm(arm)
        assert cosine > 0.999 and 0.59 < share < 1.01
    assert came > 5


def test_a_room_has_colours_that_there_are():
    for seed in range(20):
        picture, _ = drawings.a_room(np.random.default_rng(seed), story("push", seed))
        assert picture.min() >= 0


def test_clutter_stands_upright_but_for_a_little(monkeypatch):
    turns = []
    monkeypatch.setattr(draw, "thing", lambda *what: turns.append(what[5] if what[5:] else 0))
    for seed in range(20):
        drawings._clutter(np.random.default_rng(seed), draw.empty(), 20, (0, 0), (84, 84))
    turned = np.array(turns)[np.array(turns) != 0]
    assert len(turned) > 100 and abs(turned.mean()) < 0.1 and turned.std() < 0.5


def drawers(monkeypatch):
    """The polygons and sticks of a hundred drawers and doors: [(story, polygons, sticks), ...]."""
    out = []
    for seed in range(100):
        told, polygons, sticks = story("drawer", seed), [], []
        monkeypatch.setattr(draw, "polygon", lambda layer, at, *_, to=polygons: to.append(at))
        monkeypatch.setattr(draw, "stick", lambda layer, *ends, to=sticks: to.append(ends))
        drawings._object(np.random.default_rng(seed), told, GREY)(0)
        out.append((told, polygons, sticks))
    return out


def test_a_drawers_front_hides_no_handle_and_a_door_is_as_high_where_it_is_pushed(monkeypatch):
    handles = 0
    for told, (panel, *_), sticks in drawers(monkeypatch):
        # The first polygon is a door's panel or a drawer's side: upright at both ends.
        (_, top, bottom, _), height = panel[:, 1], np.ptp(panel[:, 1])
        left, right = np.abs(panel[0] - panel[3]), np.abs(panel[1] - panel[2])
        np.testing.assert_allclose(left, right)
        assert left[0] == 0 and height > 0 and top < bottom
        for _, end, *_ in sticks:
            handles += 1
            assert end[0] <= told.object[0, 0] - told.half[0] + 1e-9
    assert handles > 20


def test_who_passes_by_is_to_be_seen():
    for seed in range(30):
        passes = drawings.a_bystander(np.random.default_rng(seed), T)
        assert any(passes(t)[..., 3].any() for t in range(0, T, 6))
