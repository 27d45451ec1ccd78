"""Arms, controller, camera and motion compute what they did when the shipped results were made."""

from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest
from digests import digest

from tasks.push import Push
from tasks.world import World, expert_actions, random_actions, viewer
from tasks.world.bodies import ARMS, human, limb
from tasks.world.env import Leg, _scatter
from tasks.world.meshes import normals, read_mesh, read_obj
from tasks.world.recording import Recording, load_recordings, save_recordings
from tasks.world.scene import LOOKS, Part, numbers

EMBODIMENTS = ("robot", "human")
every_arm = pytest.mark.parametrize("embodiment", EMBODIMENTS)


def numbers_of(*values):
    return np.concatenate([np.ravel(np.asarray(value, float)) for value in values])


@every_arm
def test_an_arm_is_built_as_it_was(embodiment, make, golden):
    """Link by link: mass, friction, inertia, joint and where it stands; shape by shape: its size
    and place. No kinds and numbers of links among them: they would drown what is small."""
    arm = make("push", embodiment).arm
    p, spec, links, kinds = arm.p, arm.spec, [], []
    for link in range(-1, p.getNumJoints(arm.body)):
        mass, friction, inertia = p.getDynamicsInfo(arm.body, link)[:3]
        joint = p.getJointInfo(arm.body, link) if link >= 0 else ()
        links.append([mass, friction, *inertia, *(joint[14] if joint else (0, 0, 0))])
        felt = len(p.getCollisionShapeData(arm.body, link))
        kinds.append(str((felt, *(joint[2:3] + joint[6:7] + joint[8:12] + joint[13:14]))))
    shapes = [
        numbers_of(shape[3], shape[5], shape[6][:3]) for shape in p.getVisualShapeData(arm.body)
    ]
    golden(
        {
            "links": np.round(links, 4),
            "kinds": [len(kinds), *sorted(set(kinds))],
            "shapes": np.round(shapes, 4),
            "names": list(arm.links),
            "joints": arm.joints,
            "tip": arm.tip,
            "limits": numbers_of(spec.effort, spec.speed, arm.effort, arm.speed),
            "stands": numbers_of(spec.base, spec.home, arm.down),
            "touches": list(spec.reach_links),
            "colours": {name: str(rgba) for name, rgba in spec.colours.items()},
            "gains": [arm.kp, arm.kd, arm.kp_posture],
        }
    )


def test_the_humans_limbs_are_drawn_as_they_were(golden):
    figures = {}
    for name, text in {**human().meshes, "own": limb((0, 0.1), (0.1, 0.2), (0.4, 0.1))}.items():
        turned = [line.split()[1:] for line in text.splitlines() if line[:3] == "vn "]
        figures[f"{name}: corners"] = digest(read_obj(text))
        figures[f"{name}: normals"] = [len(turned), *digest(np.array(turned, float))]
    golden(figures)


def test_the_models_files_say_what_they_said(golden):
    """The text of the human's model, and of the robot's its changes to the library's file."""
    figures = {}
    for name, spec in ((name, ARMS[name]()) for name in EMBODIMENTS):
        words = spec.urdf.replace('"', " ").replace("<", " ").replace("/>", " ").split()
        some = [float(w) for w in words if w.lstrip("-").replace(".", "", 1).isdigit()]
        figures[name] = [len(some), *digest(some)]
        figures[f"{name} has"] = [
            spec.urdf.count(word)
            for word in ("meshes/collision", "meshes/visual", "fixed", "0.112")
        ]
    golden(figures)


def sent(arm):
    """The torques that the arm sends next."""
    kept, client = [], arm.p

    class Spy:
        def __getattr__(self, name):
            return getattr(client, name)

        def setJointMotorControlArray(self, *_, forces):
            kept.append(forces)

    arm.p = Spy()
    try:
        arm.actuate()
    finally:
        arm.p = client
    return np.array(kept[0])


@every_arm
@pytest.mark.parametrize("name", ["reach", "slide"])
def test_the_controller_sends_the_torques_that_it_sent(name, embodiment, make, golden):
    """At rest, moving, with a goal that is too far, beyond what joints can, and out of the box."""
    env = make(name, embodiment)
    env.reset(seed=0)
    arm, rng, figures = env.arm, np.random.default_rng(0), {}
    arm.reset(np.array([0.52, 0.0, 0.1]))
    q = arm.state()[0]
    figures["posture"] = q
    figures["jacobian"] = digest(arm.jacobian(q))
    figures["inertia"] = digest(arm.mass_matrix(q))
    pushed = rng.normal(size=7)
    for kind, turn, spin, goal in (
        ("at rest", 0, 0, (0.52, 0, 0.1)),
        ("near", 0.002, 0.05, (0.525, 0.002, 0.102)),
        ("far", 0.02, 0.3, (0.60, -0.01, 0.15)),
        ("knocked", 0.0, 3.0, (0.50, 0.005, 0.06)),
        ("out of its box", 0.08, 0.2, (0.53, 0.0, 0.1)),
    ):
        for joint, angle, v in zip(arm.joints, q + turn * pushed, spin * pushed, strict=True):
            arm.p.resetJointState(arm.body, joint, angle, v)
        arm.goal = np.array(goal)
        arm.prepare()
        figures[f"{kind}: error"] = arm._error(arm.goal)
        figures[kind] = sent(arm)
        figures[f"{kind}: goal"] = arm.goal
        arm.p.resetJointState(arm.body, arm.joints[2], q[2] + 0.01, 0.2)
        figures[f"{kind}: turned on"] = sent(arm)
    golden(figures, atol=1e-4)


@every_arm
def test_the_brake_leaves_what_it_left(embodiment, make, golden):
    """Speeds on both sides of each limit and of both signs; angles stay."""
    arm, figures = make("slide", embodiment).arm, {}
    for share in (0.98, 1.02, -0.97, -3.0):
        for joint, angle, v in zip(arm.joints, arm.home, share * arm.speed, strict=True):
            arm.p.resetJointState(arm.body, joint, angle, v)
        arm.brake()
        figures[f"{share}"] = numbers_of(*arm.state())
    golden(figures)


@every_arm
def test_a_reset_finds_the_joints_that_it_found(embodiment, make, golden):
    """Tips in the corners of the widest box and far from the rest posture."""
    arm, figures = make("slide", embodiment).arm, {}
    for tip in ((0.42, -0.01, 0.015), (0.74, 0.01, 0.17), (0.64, 0.05, 0.28), (0.45, -0.1, 0.17)):
        arm.reset(np.array(tip))
        figures[str(tip)] = [*arm.state()[0], *arm.goal]
    golden(figures, atol=1e-4)


@every_arm
@pytest.mark.parametrize("name", ["reach", "slide", "drawer"])
def test_goal_and_tip_move_as_they_moved(name, embodiment, make, golden):
    """Actions of up to 1.6 that change every third step: to the box's sides, and on the leash.

    The thing is far away, so that nothing is touched.
    """
    env = make(name, embodiment)
    env.reset(seed=0)
    if name == "slide":
        env.world.p.resetBasePositionAndOrientation(env.puck, (0.9, 0.25, 0.02), (0, 0, 0, 1))
    box, rng, rows = np.array(env.WORKSPACE), np.random.default_rng(5), []
    low = 0.4 if name == "drawer" else 0  # a drawer's handle is always in the way
    for k in range(24):
        if k % 3 == 0:
            action = rng.uniform(-1.6, 1.6, 3) - (low, 0, 0)
        env.step(action)
        x, R = env.arm.tip_pose()
        q, dq = env.arm.state()
        rows.append(numbers_of(env.arm.goal, x, digest(R), digest(q), digest(dq)))
    rows = np.array(rows)
    golden(
        {
            "goal and tip": rows[::3, :6].round(5),
            "joints": rows[::6, 6:].round(4),
            "at the box's sides": (np.abs(rows[:, None, :3] - box) < 1e-9).sum((0, 1)),
        },
        atol=5e-5,
    )


@pytest.fixture(params=EMBODIMENTS)
def world(request):
    """A world with a ball and a rod for scenery, and a thing of two parts that moves."""
    world = World(request.param, ((0.6, 0.1, 0.2), 1.3))
    before = world.backdrop.copy()
    ball = world.sphere(0.03, (0.5, 0.0, 0.2), (0.2, 0.4, 0.9, 1), mass=0.3)
    rod = world.cylinder(0.02, 0.3, (0.7, 0.1, 0.15), (0.9, 0.4, 0.2, 1), solid=False)
    world.paint()
    parts = [
        Part("box", (0.02, 0.03, 0.04), (0.1, 0.02, 0.0), (1, 0, 0, 1), 0.5),
        Part("sphere", (0.03,), (0.0, 0.05, 0.06), (0, 1, 0, 1), 0.1, solid=False),
    ]
    bodies = world.fixed(parts, (0.45, 0, 0.3)), ball, rod
    yield SimpleNamespace(world=world, wall=before, bodies=bodies, look=LOOKS[request.param])
    world.p.disconnect()


def test_the_world_is_made_and_seen_from_where_it_was(world, golden):
    world, look, bodies, p = world.world, world.look, world.bodies, world.world.p
    engine = p.getPhysicsEngineParameters()
    points = [world.pixel(point) for point in ((0.5, 0, 0.2), (0.8, -0.1, 0.0), (0.3, 0.2, 0.4))]
    places = [world.position(body) for body in bodies]
    world.take_apart()
    golden(
        {
            "view": world.view,
            "projection": world.projection,
            "light": world.light,
            "engine": [
                engine["fixedTimeStep"],
                *(engine[f"gravityAcceleration{a}"] for a in "XYZ"),
            ],
            "look": numbers_of(look["wall"], look["table"]),
            "table": numbers_of(
                world.position(world.table),
                p.getDynamicsInfo(world.table, -1)[:2],
                p.getCollisionShapeData(world.table, -1)[0][3],
            ),
            "depth": digest(world.depth),
            "hidden": [p.getVisualShapeData(body)[0][7][3] for body in world.scenery],
            "pixels": points,
            "places": places,
            "masses": [p.getDynamicsInfo(body, -1)[0] for body in bodies],
            "apart": [world.position(body) for body in bodies],
            "felt": [len(p.getCollisionShapeData(body, -1)) for body in bodies],
        }
    )


def test_the_world_looks_as_it_did(world, golden):
    frame = world.world.render().astype(float)
    golden(
        {
            "wall": world.wall[::40, 0],
            "backdrop": digest(world.world.backdrop),
            "frame": frame.reshape(6, 14, 6, 14, 3).mean((1, 3)).round(1),
        },
        atol=0.1,
    )


def test_numbers_of_a_picture_keep_their_kind():
    for given in (np.array([1, 2], np.uint8), (1, 2)):
        assert numbers(given, np.uint8).dtype == np.uint8
        assert numbers(given, np.float32).dtype == np.float32
        np.testing.assert_array_equal(numbers(given, np.float32), [1, 2])


def test_how_deep_a_hand_is_in_a_thing_is_what_it_was(make, golden):
    """A cube under, before, behind and far from the fingers."""
    figures = {}
    for arm in EMBODIMENTS:
        env = make("push", arm)
        env.reset(seed=0)
        env.arm.reset(np.array([0.55, 0, 0.03]))
        places = [(0.59, 0.025), (0.58, 0.025), (0.525, 0.03), (0.55, 0.01), (0.7, 0.025)]
        depths = []
        for x, z in places:
            env.world.p.resetBasePositionAndOrientation(env.cube, (x, 0, z), (0, 0, 0, 1))
            depths.append(env.contact())
        figures[arm] = np.round(depths, 5)
        figures[f"{arm}: pixels"] = env.true_pixels()
        figures[f"{arm}: state"] = env.true_state()
        figures[f"{arm}: distance"] = env.distance()
    golden(figures, atol=1e-4)


def acted(legs, rng, step=0.03):
    """The expert's actions where the arm is always at its goal."""
    arm = SimpleNamespace(goal=np.array([0.46, 0.0, 0.12]))
    env = SimpleNamespace(arm=arm, STEP=step, waypoints=lambda: legs)
    for action in expert_actions(env, rng):
        arm.goal = arm.goal + step * action
        yield np.concatenate([action, arm.goal])


def test_an_experts_legs_bend_last_and_pause_as_they_did(golden):
    """Of five people: three legs, of which the last is exact; one of them is too fast."""
    legs = [
        Leg(np.array([0.50, 0.004, 0.02]), 0.6),
        Leg(np.array([0.66, 0.0, 0.03]), 0.5),
        Leg(np.array([0.70, 0.0, 0.02]), 0.21, exact=True),
    ]
    figures = {}
    for seed in range(6):
        rows = np.array(list(acted(legs, np.random.default_rng(seed) if seed else None)))
        figures[f"{seed}"] = [len(rows), *digest(rows[:, :3]), *digest(rows[:, 3:])]
        figures[f"{seed}: still"] = np.flatnonzero((rows[:, :3] == 0).all(1))
        figures[f"{seed}: first"] = rows[[3, -2]].round(4)
    # who has many legs shows how often people pause, and for how long
    many = [Leg(np.array([0.5 + 0.1 * (k % 2), 0, 0.02]), 0.2) for k in range(90)]
    rows = np.array(list(acted(many, np.random.default_rng(0))))
    still = (rows[:, :3] == 0).all(1)
    figures["many"] = [len(rows), still.sum(), *digest(np.flatnonzero(still)), *digest(rows)]
    golden(figures, atol=2e-4)


def test_random_actions_are_those_that_were_drawn(golden):
    figures = {}
    for towards in (0, -1, 1, 0.5):
        rows = np.array(list(islice(random_actions(np.random.default_rng(2), towards), 300)))
        new = np.flatnonzero(np.r_[True, (np.diff(rows, axis=0) != 0).any(1)])
        figures[f"{towards}"] = rows[new[:6]].round(4)
        figures[f"{towards}: held"] = np.diff(new)
        figures[f"{towards}: bounds"] = numbers_of(rows.min(0), rows.max(0)).round(4)
    golden(figures, atol=2e-4)


def test_normals_are_those_that_were_drawn(golden):
    """Of a roof: its halves meet at 30 degrees, at 50 its gable; one face is larger."""
    a, b = np.radians([30, 80])
    ridge, eave = np.array([0, 1.0, 0]), np.array([0, 0, 0.0])
    one = np.array([eave, [2, 0, 0], ridge])
    two = np.array([eave, ridge, [-4 * np.cos(a), 0, -4 * np.sin(a)]])
    three = np.array([eave, [-np.cos(b), 0, -np.sin(b)], [0, -1.0, 0]])
    flat = np.zeros((1, 3, 3))
    roof = np.concatenate([[one, two, three], flat])
    lowered = viewer.Mesh(roof[:3]).lower({})
    golden(
        {
            "normals": normals(roof),
            "keys": sorted(lowered),
            "type": lowered["type"],
            "attributes": list(lowered["data"]["attributes"]),
            "packed": np.frombuffer(
                lowered["data"]["attributes"]["normal"]["array"].data, np.float32
            ),
        }
    )


def test_a_file_of_triangles_is_read_as_it_was(tmp_path):
    """A square of four corners, counted from the end, is two triangles; STL is binary."""
    (tmp_path / "square.OBJ").write_text(
        "# a square\n\nv 0 0 0\nv 2 0 0 9\nv 2 1 0\nv 0 1 0\nvn 0 0 1\nf -4/1/1 -3//1 3 4/2\n"
    )
    square = [[[0, 0, 0], [2, 0, 0], [2, 1, 0]], [[0, 0, 0], [2, 1, 0], [0, 1, 0]]]
    np.testing.assert_array_equal(read_mesh(tmp_path / "square.OBJ"), square)
    record = np.zeros(2, np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("more", "<u2")]))
    record["n"], record["v"] = 7, square
    data = b"t" * 80 + np.uint32(2).tobytes() + record.tobytes()
    (tmp_path / "square.STL").write_bytes(data)
    np.testing.assert_array_equal(read_mesh(tmp_path / "square.STL"), square)
    for short in (data[:-1], data[:82], data + b"0"):
        (tmp_path / "cut.stl").write_bytes(short)
        with pytest.raises(ValueError, match=r"cut\.stl: not a binary STL file; export"):
            read_mesh(tmp_path / "cut.stl")
    with pytest.raises(ValueError, match=r"arm\.dae: the viewer reads OBJ and binary STL meshes"):
        read_mesh(tmp_path / "arm.dae")


def test_a_file_of_recordings_has_the_names_and_types_that_it_had(tmp_path):
    """Two episodes of different length: what is read again is each one's own."""
    rng = np.random.default_rng(0)

    def episode(seed, n, scatter):
        return Recording(
            seed, scatter, rng.normal(size=(n - 1, 3)).astype(np.float32),
            rng.normal(size=(n, 9)).astype(np.float32), np.arange(n) / 25, rng.random(n) < 0.5,
        )  # fmt: skip

    given = [episode(7, 4, True), episode(3, 6, False), episode(5, 2, True)]
    save_recordings(tmp_path / "some.npz", given)
    with np.load(tmp_path / "some.npz") as file:
        kinds = {name: (file[name].dtype.str, file[name].shape) for name in file.files}
    assert kinds == {
        "seeds": ("<i8", (3,)),
        "scatter": ("|b1", (3,)),
        "lengths": ("<i8", (3,)),
        "actions": ("<f4", (9, 3)),
        "states": ("<f4", (12, 9)),
        "times": ("<f8", (12,)),
        "success": ("|b1", (12,)),
    }
    for was, now in zip(given, load_recordings(tmp_path / "some.npz"), strict=True):
        assert (was.seed, was.scatter) == (now.seed, now.scatter)
        for a, b in zip(was[2:], now[2:], strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    ("options", "asked"),
    [(None, False), ({}, False), ({"scatter": True}, True), ({"scatter": np.bool_(False)}, False)],
)
def test_a_start_is_scattered_where_it_was_asked_for(options, asked):
    assert _scatter(options) is asked


def test_what_an_environment_refuses_it_refuses_in_its_words():
    messages = []
    for options in (
        {"embodiment": "cat"}, {"observation": "depth"}, {"render_mode": "human"},
        {"jitter": 0.051}, {"jitter": -0.001}, {"jitter": "far"},
    ):  # fmt: skip
        with pytest.raises(Exception) as told:
            Push(**options)
        messages.append(str(told.value))
    assert messages == [
        "embodiment='cat': choose 'robot' or 'human'.",
        "observation='depth': choose 'rgb' or 'state'.",
        "render_mode='human': choose 'rgb_array' or None.",
        "jitter=0.051: give metres, from 0 to 0.05.",
        "jitter=-0.001: give metres, from 0 to 0.05.",
        "jitter='far': give metres, from 0 to 0.05.",
    ]


def test_in_each_of_ten_simulation_steps_the_arm_is_driven_and_then_held_back(make, monkeypatch):
    env, done = make("reach"), []
    env.reset(seed=0)
    monkeypatch.setattr(env.arm, "prepare", lambda: done.append("prepared"))
    monkeypatch.setattr(env.arm, "actuate", lambda: done.append("driven"))
    monkeypatch.setattr(env.arm, "brake", lambda: done.append("held"))
    monkeypatch.setattr(env, "move", lambda: done.append("moved"))
    env.step(np.zeros(3))
    assert done == ["moved", "prepared", *10 * ["driven", "held"]]
