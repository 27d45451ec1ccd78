"""Bodies of a world, made for a task that is yet to be written: where parts stand, what is felt."""

import ctypes
import os
import sys

import numpy as np
import pytest

from tasks.world import GREEN, RED, Part, TaskEnv, World, scene


@pytest.fixture
def world():
    world = World("robot", TaskEnv.CAMERA)
    yield world
    world.p.disconnect()


ONE = Part("box", (0.01, 0.02, 0.03), (0.1, 0.2, 0.3), RED, 0.5)
TWO = Part("cylinder", (0.02, 0.05), (0.15, 0.2, 0.4), GREEN, 0.25)
THREE = Part("sphere", (0.04,), (0.0, -0.1, 0.35), GREEN, 0.125, solid=False)
AT = np.array([0.5, 0.05, 0.2])


def places(p, body, links):
    """Where links of a body are, -1 its base."""
    return [
        p.getBasePositionAndOrientation(body)[0]
        if link < 0
        else p.getLinkState(body, link, computeForwardKinematics=True)[4]
        for link in links
    ]


def test_parts_of_a_body_stand_relative_to_it_wherever_its_first_part_is(world):
    parts, p = [ONE, TWO, THREE], world.p
    wanted = [AT + part.place for part in parts]
    fixed = world.fixed(parts, AT)
    np.testing.assert_allclose(places(p, fixed, (-1, 0, 1)), wanted, atol=1e-9)
    sliding = world.sliding(parts, AT, axis=(0, 1, 0))
    np.testing.assert_allclose(places(p, sliding, (0, 1, 2)), wanted, atol=1e-9)
    p.resetJointState(sliding, 0, 0.07)
    np.testing.assert_allclose(
        places(p, sliding, (0, 1, 2)), np.add(wanted, (0, 0.07, 0)), atol=1e-9
    )
    for body, first in ((fixed, -1), (sliding, 0)):
        masses = [p.getDynamicsInfo(body, first + i)[0] for i in range(3)]
        assert masses == [0.5, 0.25, 0.125]
        felt = [len(p.getCollisionShapeData(body, first + i)) for i in range(3)]
        assert felt == [1, 1, 0]


def test_what_is_felt_of_a_shape_is_as_large_as_what_is_seen_of_it(world):
    """Half extents of a box, radius and height of what stands upright, and a ball's radius."""
    p = world.p
    for body, half in (
        (world.box((0.01, 0.02, 0.03), (0, 0, 1), RED), (0.01, 0.02, 0.03)),
        (world.cylinder(0.02, 0.1, (1, 0, 1), RED), (0.02, 0.02, 0.05)),
        (world.sphere(0.04, (2, 0, 1), RED), (0.04, 0.04, 0.04)),
    ):
        low, high = np.array(p.getAABB(body))
        np.testing.assert_allclose((high - low) / 2, half, atol=0.002)  # Bullet adds a margin
        seen = p.getVisualShapeData(body)[0]
        full = {p.GEOM_BOX: seen[3], p.GEOM_SPHERE: 3 * [2 * seen[3][0]]}.get(
            seen[2], (2 * seen[3][1], 2 * seen[3][1], seen[3][0])
        )
        np.testing.assert_allclose(np.array(full) / 2, half, atol=1e-9)
        assert seen[7] == pytest.approx(RED)


def test_nothing_but_contact_brakes_a_thing(world):
    """In free flight a second long it keeps its speed along x and its spin."""
    p, bodies = world.p, []
    for i, mass in enumerate((0.1, 2.0)):
        bodies += [
            world.sphere(0.03, (i, 0, 20), RED, mass=mass),
            world.box((0.03, 0.03, 0.03), (i, 1, 20), RED, mass=mass),
            world.cylinder(0.03, 0.06, (i, 2, 20), RED, mass=mass),
        ]
    bodies.append(world.fixed([ONE._replace(place=(0, 0, 0))], (0, 3, 20)))
    for body in bodies:
        p.resetBaseVelocity(body, (0.5, 0, 0), (0, 0, 3))
    for _ in range(250):
        p.stepSimulation()
    for body in bodies:
        (along, _, falls), spin = p.getBaseVelocity(body)
        assert along == pytest.approx(0.5, rel=1e-6) and spin[2] == pytest.approx(3, rel=1e-6)
        assert falls == pytest.approx(-9.81, rel=1e-6)


def test_a_rail_has_no_friction_of_its_own(world):
    p = world.p
    body = world.sliding([ONE], AT, axis=(1, 0, 0))
    p.setJointMotorControl2(body, 0, p.VELOCITY_CONTROL, force=0)
    p.resetJointState(body, 0, 0, targetVelocity=0.4)
    for _ in range(250):
        p.stepSimulation()
    assert p.getJointState(body, 0)[1] == pytest.approx(0.4, rel=1e-6)


def test_what_was_taken_apart_touches_nothing(world):
    """Two cubes, one in the other on the table, and what never moves stays."""
    p = world.p
    still = world.box((0.02, 0.02, 0.02), (0.6, 0, 0.02), RED)
    for _ in range(2):
        world.box((0.02, 0.02, 0.02), (0.5, 0, 0.01), RED, mass=0.1)
    p.performCollisionDetection()
    assert p.getContactPoints()
    world.take_apart()
    p.performCollisionDetection()
    assert not p.getContactPoints()
    assert world.position(still) == pytest.approx((0.6, 0, 0.02))


def free():
    """The numbers that the next eight files would get."""
    numbers = [os.open(os.devnull, os.O_RDONLY) for _ in range(8)]
    for number in numbers:
        os.close(number)
    return numbers


def test_a_world_leaves_no_file_open_and_standard_output_as_it_was(capfd):
    print("before", end="")
    before = free()
    for _ in range(3):
        World("robot", TaskEnv.CAMERA).p.disconnect()
    assert free() == before
    print(" after")
    assert capfd.readouterr() == ("before after\n", "")


def test_what_is_said_while_a_world_begins_is_not_heard_and_what_was_said_before_is(capfd):
    with open(1, "w", closefd=False) as out, pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdout", out)  # which holds back, as it does into a file
        print("before", end="")
        with scene._silence():
            out.flush()
            os.write(1, b"out")
            os.write(2, b"error")
    assert capfd.readouterr() == ("before", "")


@pytest.mark.skipif(sys.platform != "linux", reason="needs Linux, whose C library is asked by name")
def test_what_c_holds_back_while_a_world_begins_is_not_heard_later(capfd):
    C = ctypes.CDLL(None)
    out, whole, none = ctypes.c_void_p.in_dll(C, "stdout"), 0, 2  # _IOFBF and _IONBF
    room = ctypes.create_string_buffer(4096)
    C.setvbuf(out, room, whole, len(room))
    with scene._silence():
        C.printf(b"from C")
    C.fflush(None)
    C.setvbuf(out, None, none, 0)
    assert capfd.readouterr() == ("", "")


def test_what_was_painted_is_hidden_from_the_camera_until_it_is_asked_for(world):
    """It is rendered once; the colours are kept."""
    p = world.p
    block = world.box((0.05, 0.05, 0.05), (0.6, 0, 0.05), (0.2, 0.4, 0.6, 1))
    world.paint()
    assert world.scenery == [world.table, block]
    for shown in (False, True, False):
        world.show_scenery(shown)
        for body in world.scenery:
            assert p.getVisualShapeData(body)[0][7][3] == shown
        assert p.getVisualShapeData(block)[0][7][:3] == pytest.approx((0.2, 0.4, 0.6))


def test_the_table_is_60_centimetres_deep_and_its_top_is_at_height_0(world):
    """What is pushed aside by 30 cm falls, and an arm's goal is never below the top."""
    low, high = np.array(world.p.getAABB(world.table))
    np.testing.assert_allclose([low[1], high[1], high[2]], [-0.3, 0.3, 0], atol=0.002)
    np.testing.assert_allclose([low[0], high[0]], [0, 1.6], atol=0.002)
    assert world.p.getDynamicsInfo(world.table, -1)[1] == 1.0  # an object's friction is its own
