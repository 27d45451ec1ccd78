"""What drawings are made of, by hand: places, sizes, turns and colours on a layer."""

import numpy as np
import pytest

from lbw_minimal.clips import drawn_shapes as draw

WHITE, GREY, RED = np.full(3, 255.0), np.full(3, 100.0), np.array([200.0, 0, 0])


def middle(opacity):
    """The centre of what is drawn, (x, y) in pixels from the edges, weighed by its opacity."""
    y, x = np.mgrid[: draw.SIZE, : draw.SIZE] + 0.5
    return np.array([(x * opacity).sum(), (y * opacity).sum()]) / opacity.sum()


def extent(opacity):
    """Left, right, top and bottom of what is drawn, in whole pixels."""
    y, x = np.nonzero(opacity > 127)
    return x.min(), x.max() + 1, y.min(), y.max() + 1


def drawn(kind, half=(10, 6), turn=0.0, at=(40, 50), colours=(GREY, RED)):
    layer = draw.empty()
    draw.thing(layer, kind, np.array(at, float), np.array(half, float), colours, turn)
    return layer


def test_a_layer_covers_a_picture_by_its_opacity():
    """Colour times opacity is on the layer: half of 200 in front of half of 60."""
    layer = draw.empty()
    layer[0, 0], layer[0, 1] = (100, 100, 100, 255), (100, 0, 0, 51)
    picture = np.full((84, 84, 3), 60, np.float32)
    over = draw.over(picture, layer)
    assert over[0, 0].tolist() == [100, 100, 100]
    np.testing.assert_allclose(over[0, 1], [100 + 60 * 0.8, 48, 48], atol=1e-4)
    assert (over[1:] == 60).all()


def test_places_are_counted_from_the_pictures_edge():
    layer = draw.empty()
    draw.polygon(layer, np.array((24.5, 32.5)) + 8 * draw.ROUND, RED)
    np.testing.assert_allclose(middle(layer[..., 3]), [24.5, 32.5], atol=0.15)
    assert layer[32, 24].tolist() == [200, 0, 0, 255]


def test_opacity_0_cuts_a_hole():
    layer = drawn("front", half=(20, 20))
    draw.polygon(layer, np.array([(36.0, 46), (44, 46), (44, 54), (36, 54)]), WHITE * 0, 0)
    assert layer[50, 40].tolist() == [0, 0, 0, 0] and layer[50, 30, 3] == 255


def test_a_stick_is_as_thick_at_either_end_as_that_ends_radius():
    layer = draw.empty()
    draw.stick(layer, np.array([20.0, 40]), np.array([60.0, 40]), 3, 8, WHITE)
    thick = (layer[..., 3] / 255).sum(0)
    # Twice the radius, and OpenCV's soft edge of a pixel.
    assert thick[20] == pytest.approx(7, abs=1) and thick[59] == pytest.approx(17, abs=1)
    assert extent(layer[..., 3])[:2] == (pytest.approx(17, abs=1), pytest.approx(68, abs=1))


@pytest.mark.parametrize("kind", ["box", "can", "flat", "ball", "front"])
def test_a_thing_stands_about_its_middle_in_its_size(kind):
    sides = np.array(extent(drawn(kind, half=(16, 24), at=(40, 42))[..., 3]))
    assert np.abs(sides - (24, 56, 18, 66)).max() <= 1


def test_a_mugs_handle_is_a_ring_on_its_right():
    layer = drawn("mug", half=(20, 20), at=(30, 50))
    left, right, *_ = extent(layer[..., 3])
    # The body ends at 50. The handle's middle is at 52, its radii are 7 and 12.
    assert left == pytest.approx(10, abs=1) and right == pytest.approx(64, abs=1)
    assert layer[50, 61, 3] == 255 and layer[50, 55, 3] == 0


def test_a_turned_thing_has_its_width_upright():
    """A quarter turn clockwise puts what was on the right below."""
    sides = np.array(extent(drawn("flat", turn=np.pi / 2)[..., 3]))
    assert np.abs(sides - (34, 46, 40, 60)).max() <= 1
    mug = drawn("mug", half=(20, 20), turn=np.pi / 2, at=(40, 40))[..., 3]
    assert mug[71, 40] == 255 and mug[10, 40] == 0


def test_a_things_second_colour_is_what_is_on_it():
    """A label half as wide and a third as high: on the middle, and on no edge."""
    front = drawn("front")
    assert front[50, 40, :3].tolist() == [200, 0, 0]
    assert front[50, 33, :3].tolist() == [100, 100, 100]
    can = drawn("can", half=(10, 20))
    assert can[50, 32, :3].tolist() == [200, 0, 0]  # all around
    assert can[50 + 10, 32, 0] == 85 and can[50 + 10, 40, 0] == 100  # its lit side
    assert can[50 - 15, 40, 0] == 70  # its lid
    box = drawn("box", half=(10, 10))
    assert box[50 + 3, 40, :3].tolist() == [200, 0, 0] and box[50 + 8, 40, 0] == 85
    assert box[42, 35, 0] == box[43, 40, 0] == box[42, 45, 0] == 100  # its top
    ball = drawn("ball", half=(10, 10))
    assert ball[48, 38, 0] == 100 and ball[56, 46, 0] == 85  # lit from the upper left


def test_turns_are_clockwise_in_the_picture():
    np.testing.assert_allclose(draw.turned(np.array([1.0, 0]), np.pi / 2), [0, 1], atol=1e-12)
    np.testing.assert_allclose(draw.turned(np.array([0.0, 1]), np.pi / 2), [-1, 0], atol=1e-12)


def test_a_colour_near_another_is_within_some_grey_levels_and_skins_are_peoples():
    rng = np.random.default_rng(0)
    near = np.array([draw.a_colour(rng, GREY) for _ in range(500)]) - GREY
    assert np.abs(near.mean(0)).max() < 3 and near.std() == pytest.approx(16, rel=0.1)
    far = np.array([draw.a_colour(rng) for _ in range(500)])
    assert far.min() >= 0 and far.max() <= 255 and far.mean() == pytest.approx(130, abs=8)
    # more often greyish than not: nine in ten have channels within 80 levels of each other
    assert np.median(np.ptp(far, axis=1)) < 60
    skin = np.array([draw.a_skin(rng) for _ in range(500)])
    between = np.sort(draw.SKINS, axis=0)
    assert (skin > between[0] - 32).all() and (skin < between[-1] + 32).all()
    assert (skin[:, 0] > skin[:, 2]).mean() > 0.98  # redder than blue


def test_a_surface_is_even_where_it_has_no_strength_and_about_1_elsewhere():
    rng = np.random.default_rng(0)
    assert (draw.a_surface(rng, 0.0) == 1).all()
    many = np.stack([draw.a_surface(rng, 0.1) for _ in range(100)])
    assert many.shape == (100, 84, 84, 1) and many.mean() == pytest.approx(1, abs=0.02)
    assert 0.03 < many.std(axis=(1, 2)).mean() < 0.12


def test_a_hand_reaches_from_its_wrist_to_its_tip_and_no_farther():
    """In lengths of the hand: u from -1 to 0, to either side by half of it at most."""
    for u_a, v_a, u_b, v_b, r_a, r_b in (np.array(hand).T for hand in draw.HANDS.values()):
        u, v, r = (np.concatenate(ends) for ends in ((u_a, u_b), (v_a, v_b), (r_a, r_b)))
        assert u.min() >= -1 and -0.05 <= (u + r).max() <= 0
        assert np.abs(v).max() < 0.5 and r.min() >= 0.05 and (u_a < u_b).all()


def person(**of):
    """A person whose arm has what a test says of it, and nothing else that is left to chance."""
    someone = draw.Person(np.random.default_rng(0), reach=50)
    plain = dict(
        hand=draw.HANDS["pointing"], length=12.0, flip=1, down=False, bend=0.0, sway=0.0,
        skin=RED, cloth=WHITE, glove=GREY, wrist=2.0, elbow=3.0, sleeve=-1.0, loose=1.5,
        knit=np.ones((84, 84, 1), np.float32), elbow_side=1, bones=np.array([30.0, 30.0]),
        torso=None, light=np.zeros(2), tool=0.0,
    )  # fmt: skip
    vars(someone).update(plain | of)
    return someone


def test_both_bones_of_an_arm_are_as_long_as_they_are_and_meet_above():
    """Shoulder and wrist 40 apart, bones of 25 and 30: the law of cosines."""
    someone = person(bones=np.array([25.0, 30.0]))
    a, b = np.array([10.0, 60]), np.array([50.0, 60])
    elbow = someone._elbow(a, b)
    assert np.linalg.norm(elbow - a) == pytest.approx(25)
    assert np.linalg.norm(elbow - b) == pytest.approx(30)
    assert elbow[1] < 60
    below = person(bones=np.array([25.0, 30.0]), elbow_side=-1)._elbow(a, b)
    np.testing.assert_allclose(below, (elbow[0], 120 - elbow[1]))


def test_an_arm_that_cannot_reach_is_stretched_out():
    elbow = person(bones=np.array([10.0, 20.0]))._elbow(np.array([0.0, 0]), np.array([60.0, 0]))
    assert elbow[1] == 0


def test_the_arm_ends_at_its_tip_along_the_way_from_its_shoulder():
    layer = person().draw(np.array([70.0, 40]), np.array([5.0, 40]), 0.0)
    # A pointing finger is 0.06 of the hand thick, and its middle that far behind the tip.
    assert extent(layer[..., 3])[1] == pytest.approx(70, abs=1)
    glove = (layer[..., 0] > 60) & (layer[..., 0] < 130) & (layer[..., 3] == 255)
    assert middle(glove)[0] == pytest.approx(61, abs=3)  # the hand is 12 long


def test_a_hand_that_points_down_is_above_its_tip():
    layer = person(down=True).draw(np.array([60.0, 60]), np.array([5.0, 40]), 0.0)
    glove = (layer[..., 0] > 60) & (layer[..., 0] < 130) & (layer[..., 3] == 255)
    x, y = middle(glove)
    assert x == pytest.approx(60, abs=2) and 47 < y < 58


def test_a_tools_end_is_the_tip_and_the_hand_holds_its_other_end():
    tool = dict(tool=20.0, tool_radius=1.5, tool_turn=0.0, tool_colour=WHITE)
    layer = person(**tool).draw(np.array([75.0, 40]), np.array([5.0, 40]), 0.0)
    assert extent(layer[..., 3])[1] == pytest.approx(75, abs=1)
    assert (layer[40, 60:73, :3] == 255).all()
    glove = (layer[..., 0] > 60) & (layer[..., 0] < 130) & (layer[..., 3] == 255)
    assert middle(glove)[0] == pytest.approx(46, abs=3)


@pytest.mark.parametrize(("sleeve", "ends_at"), [(-1.0, 8), (0.0, 42), (0.5, 57), (1.0, 66)])
def test_a_sleeve_goes_down_the_forearm_as_far_as_it_says(sleeve, ends_at):
    """Two bones of 30 pixels in a straight line from 8 on. A sleeve ends round, some 4 pixels
    further; the hand covers one that goes to the wrist."""
    layer = person(sleeve=sleeve).draw(np.array([80.0, 40]), np.array([8.0, 40]), 0.0)
    white = (layer[40, 8:68, 2] > 180).sum()
    assert white == pytest.approx(ends_at - 8, abs=2)


def test_a_torso_hangs_below_the_shoulder():
    torso = np.array([8.0, 30.0])
    layer = person(torso=torso).draw(np.array([75.0, 20]), np.array([30.0, 20]), 0.0)
    cloth = (layer[..., 2] > 180) & (layer[..., 3] == 255)
    x, y = middle(cloth)
    # Its stick begins 0.6 wide to the left and 0.8 tall below, and is one tall.
    assert x == pytest.approx(30 - 0.6 * 8, abs=1.5) and y > 50


def test_a_hand_seen_from_above_is_half_as_long_and_as_wide_and_still_ends_at_its_tip():
    tip, shoulder = np.array([70.0, 40]), np.array([8.0, 40])
    sizes = []
    for seen in (1.0, 0.5):
        flat = person(hand=draw.HANDS["flat"], length=20.0, seen=seen, wrist=0.5, elbow=0.5)
        layer = flat.draw(tip, shoulder, 0.0)
        hand = layer[..., 1] > 60  # the glove is grey, the arm is red
        rows, columns = (np.flatnonzero(hand.any(axis)) for axis in (1, 0))
        assert columns[-1] == pytest.approx(70, abs=2)
        sizes.append((np.ptp(columns), np.ptp(rows)))
    (long, wide), (short, as_wide) = sizes
    # Sticks have round ends, which get no shorter.
    assert short < 0.65 * long and as_wide == pytest.approx(wide, abs=2)


def test_one_tool_in_four_is_longer_than_a_hand():
    tools = np.array([draw.Person(np.random.default_rng(i), 50).tool for i in range(400)])
    held = tools[tools > 0]
    assert 0.25 < len(held) / 400 < 0.35 and held.min() >= 3 and held.max() <= 32
    assert 0.15 < (held > 16).mean() < 0.35
