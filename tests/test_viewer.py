"""The meshcat mirror: what the browser is told equals what PyBullet knows, and nothing listens
anywhere."""

import asyncio
import base64
import re
import socket
import time
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pybullet as p
import pybullet_data
import pytest
import umsgpack

import tasks
from tasks import TASKS, bare
from tasks.world.meshes import normals, read_mesh, read_obj
from tasks.world.viewer import FOV, Recorder, drawing, mirror, pack, transform
from tests import browser

PANDA = Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf"


@pytest.fixture
def client():
    client = p.connect(p.DIRECT)
    yield client
    p.disconnect(client)


def low_poly_panda(client, folder):
    text = PANDA.read_text().replace("meshes/visual", "meshes/collision")
    (folder / "arm.urdf").write_text(text.replace("package://", f"{PANDA.parent}/"))
    turn = p.getQuaternionFromEuler((0.1, 0.2, 0.3))
    path = str(folder / "arm.urdf")
    return p.loadURDF(path, (0.1, 0.2, 0.3), turn, useFixedBase=True, physicsClientId=client)


def primitives(client):
    """A base and a hinged link of two shapes each, apart from their centres of mass; all kinds."""
    p.setGravity(0, 0, -9.81, client)
    turn = p.getQuaternionFromEuler

    def shapes(kinds, **options):
        return p.createVisualShapeArray(shapeTypes=kinds, physicsClientId=client, **options)

    base = shapes(
        [p.GEOM_BOX, p.GEOM_CYLINDER],
        halfExtents=[[0.1, 0.2, 0.05], [0, 0, 0]], radii=[0, 0.05], lengths=[0, 0.3],
        visualFramePositions=[[0, 0, 0.1], [0.1, 0.1, 0.2]],
        visualFrameOrientations=[turn((0, 0, 0.3)), turn((0.5, 0, 0))],
        rgbaColors=[[1, 0, 0, 1], [0, 1, 0, 0.5]],
    )  # fmt: skip
    link = shapes(
        [p.GEOM_CAPSULE, p.GEOM_SPHERE], radii=[0.04, 0.06], lengths=[0.2, 0],
        visualFramePositions=[[0.15, 0, 0], [0.3, 0, 0.05]],
        visualFrameOrientations=[turn((0, np.pi / 2, 0.2)), [0, 0, 0, 1]],
    )  # fmt: skip
    return p.createMultiBody(
        1.0, -1, base, (0.2, 0.1, 0.8), turn((0.2, 0.4, 0.1)),
        (0.05, 0.02, 0.1), turn((0.3, 0, 0.2)),
        linkMasses=[0.5], linkCollisionShapeIndices=[-1], linkVisualShapeIndices=[link],
        linkPositions=[[0.2, 0, 0.1]], linkOrientations=[turn((0, 0.3, 0))],
        linkInertialFramePositions=[[0.1, 0.03, 0]],
        linkInertialFrameOrientations=[turn((0, 0.2, 0.7))],
        linkParentIndices=[0], linkJointTypes=[p.JOINT_REVOLUTE], linkJointAxis=[[0, 1, 0]],
        physicsClientId=client,
    )  # fmt: skip


def commands(page):
    """The commands in a page, as its viewer reads them."""
    line = re.search(r"for \(const command of (\[.*\])\)", page).group(1)
    numbers = {0x16: "<u4", 0x17: "<f4"}
    ext = {k: lambda e, t=t: np.frombuffer(e.data, t) for k, t in numbers.items()}
    return [
        umsgpack.unpackb(base64.b64decode(c), ext_handlers=ext)
        for c in re.findall(r"'([^']+)'", line)
    ]


def played(page, frame):
    """What the browser draws at a frame: a list of path, three.js geometry, 4x4 world pose,
    material."""
    told = commands(page)
    fixed = {
        c["path"]: np.reshape(c["matrix"], (4, 4)).T for c in told if c["type"] == "set_transform"
    }
    for c in told:
        for part in c.get("animations", []):
            at = {t["name"]: t["keys"][frame]["value"] for t in part["clip"]["tracks"]}
            fixed[part["path"]] = transform(at[".position"], at[".quaternion"])
    drawn = []
    for c in told:
        if c["type"] == "set_object":
            path, thing = c["path"], c["object"]
            pose = fixed[path.rsplit("/", 1)[0]] @ fixed[path]
            drawn.append((path, thing["geometries"][0], pose, thing["materials"][0]))
    return drawn


def depth(client):
    """What a camera at the scene's side sees, distances (320, 320) in m, from TinyRenderer."""
    view = p.computeViewMatrix((0.6, -1.8, 1.2), (0.3, 0.1, 0.75), (0, 0, 1))
    near, far = 0.5, 5.0
    lens = p.computeProjectionMatrixFOV(32, 1, near, far)
    z = p.getCameraImage(320, 320, view, lens, renderer=p.ER_TINY_RENDERER, physicsClientId=client)[
        3
    ]
    return far * near / (far - (far - near) * np.reshape(z, (320, 320)))


def redrawn(page, frame):
    """The same picture of an empty PyBullet world in which only the page's shapes stand."""
    client = p.connect(p.DIRECT)
    for _, shape, pose, _ in played(page, frame):
        kind = shape["type"]
        if kind == "BoxGeometry":
            half = [shape["width"] / 2, shape["height"] / 2, shape["depth"] / 2]
            options = {"shapeType": p.GEOM_BOX, "halfExtents": half}
        elif kind == "SphereGeometry":
            options = {"shapeType": p.GEOM_SPHERE, "radius": shape["radius"]}
        elif kind == "CylinderGeometry":
            options = {
                "shapeType": p.GEOM_CYLINDER,
                "radius": shape["radiusTop"],
                "length": shape["height"],
            }
            pose = pose @ transform(
                (0, 0, 0), p.getQuaternionFromEuler((-np.pi / 2, 0, 0))
            )  # z along their y
        else:
            corners = shape["data"]["attributes"]["position"]["array"].reshape(-1, 3)
            options = {"shapeType": p.GEOM_MESH, "vertices": corners.tolist(),
                       "indices": list(range(len(corners)))}  # fmt: skip
        visual = p.createVisualShape(physicsClientId=client, **options)
        w = quaternion(pose[:3, :3])
        p.createMultiBody(0, -1, visual, pose[:3, 3].tolist(), w, physicsClientId=client)
    picture = depth(client)
    p.disconnect(client)
    return picture


def assert_same_picture(a, b):
    seen = (a < 4) | (b < 4)
    assert seen.sum() > 8000  # of 102,400 pixels
    off = abs(a - b)[seen] > 1e-3  # m
    # TinyRenderer cuts the ends of capsules; a capsule too long is at 0.065
    assert off.mean() < 0.045


def quaternion(R):
    """(x, y, z, w) of a rotation matrix: the eigenvector of R that is its axis, and its angle."""
    values, vectors = np.linalg.eig(R)
    axis = np.real(vectors[:, np.argmin(abs(values - 1))])
    v = np.cross(axis, [1.0, 0, 0] if abs(axis[0]) < 0.9 else [0, 1.0, 0])
    angle = np.arctan2(axis @ np.cross(v, R @ v), v @ R @ v)
    return [*(np.sin(angle / 2) * axis), np.cos(angle / 2)]


def shake(client, body, rng):
    for j in range(p.getNumJoints(body, client)):
        p.resetJointState(body, j, rng.uniform(-0.4, 0.4), physicsClientId=client)


def test_primitives_look_in_the_browser_as_in_pybullet(client):
    """Depths seen by one camera: rules out swapped axes, sizes, and forgotten inertial offsets at
    once."""
    body = primitives(client)
    shake(client, body, np.random.default_rng(0))
    recorder = Recorder(client)
    recorder.snap()
    assert_same_picture(depth(client), redrawn(recorder.html("x"), 0))


def test_the_panda_looks_in_the_browser_as_in_pybullet(client, tmp_path):
    body = low_poly_panda(client, tmp_path)
    shake(client, body, np.random.default_rng(1))
    recorder = Recorder(client)
    recorder.snap()
    assert_same_picture(depth(client), redrawn(recorder.html("x"), 0))


def test_links_stand_where_the_urdf_puts_them(client, tmp_path):
    """Forward kinematics of the URDF, multiplied out by hand, in ten random states, to a
    micrometre."""
    body = low_poly_panda(client, tmp_path)
    recorder, rng, wanted = Recorder(client), np.random.default_rng(2), []
    base = transform((0.1, 0.2, 0.3), p.getQuaternionFromEuler((0.1, 0.2, 0.3)))
    joints = ET.parse(tmp_path / "arm.urdf").getroot().findall("joint")
    number = {
        p.getJointInfo(body, j, client)[1].decode(): j for j in range(p.getNumJoints(body, client))
    }
    for _ in range(10):
        shake(client, body, rng)
        recorder.snap()
        world = {"panda_link0": base}
        for joint in joints:  # the file lists parents first
            link, origin = number[joint.get("name")], joint.find("origin")
            xyz, rpy = ([float(v) for v in origin.get(k).split()] for k in ("xyz", "rpy"))
            T = world[joint.find("parent").get("link")] @ transform(
                xyz, p.getQuaternionFromEuler(rpy)
            )
            if joint.get("type") != "fixed":
                axis = np.array([float(v) for v in joint.find("axis").get("xyz").split()])
                q = p.getJointState(body, link, client)[0]
                turns = joint.get("type") == "revolute"
                T = T @ (transform((0, 0, 0), p.getQuaternionFromAxisAngle(axis, q)) if turns
                         else transform(axis * q, (0, 0, 0, 1)))  # fmt: skip
            world[joint.find("child").get("link")] = T
        wanted.append({number[j.get("name")]: world[j.find("child").get("link")] for j in joints})
    page = recorder.html("x")
    # the right finger's mesh is the left one's, turned by half about z
    flip = np.diag([-1, -1, 1, 1])
    for i in range(10):
        for path, _, pose, _ in played(page, i):
            link = int(path.split("/")[3])
            T = base if link < 0 else wanted[i][link]
            np.testing.assert_allclose(pose, T @ flip if link == 10 else T, atol=1e-6)


def test_a_falling_body_is_drawn_at_its_frame_not_at_its_centre_of_mass(client):
    """A point of the body, known in the frame of its shapes, followed through a tumbling fall."""
    body = primitives(client)
    recorder = Recorder(client)
    p.resetBaseVelocity(body, (0.3, 0, 1), (1, 2, 3), client)
    inertial = transform((0.05, 0.02, 0.1), p.getQuaternionFromEuler((0.3, 0, 0.2)))
    wanted = []
    for _ in range(20):
        p.stepSimulation(client)
        recorder.snap()
        mass = transform(*p.getBasePositionAndOrientation(body, client))
        wanted.append(mass @ np.linalg.inv(inertial) @ (0, 0, 0.1, 1))  # the box's centre
    page = recorder.html("x")
    centres = [played(page, i)[0][2][:3, 3] for i in range(20)]
    np.testing.assert_allclose(centres, np.array(wanted)[:, :3], atol=1e-6)


def test_every_shape_keeps_its_colour(client):
    primitives(client)
    paint = [material for *_, material in played(Recorder(client).html("x"), 0)]
    assert [m["color"] for m in paint[:2]] == [0xFF0000, 0x00FF00]
    assert [(m["opacity"], m["transparent"]) for m in paint[:2]] == [(1, False), (0.5, True)]


def test_a_colour_is_written_as_red_green_and_blue_to_the_nearest_of_256(client):
    look = p.createVisualShape(p.GEOM_SPHERE, radius=0.1, rgbaColor=(0.251, 0.4, 0.749, 0.3),
                               physicsClientId=client)  # fmt: skip
    p.createMultiBody(0, -1, look, physicsClientId=client)
    ((*_, paint),) = played(Recorder(client).html("x"), 0)
    assert (paint["color"], paint["opacity"]) == (0x4066BF, pytest.approx(0.3))


def test_a_mesh_is_drawn_as_large_as_its_scale_says():
    text = "v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n"
    ((mesh, at),) = drawing(p.GEOM_MESH, (2.0, 3.0, 4.0), "/gone/a.obj", {"a.obj": text})
    np.testing.assert_array_equal(mesh.corners, [[[0, 0, 0], [2, 0, 0], [0, 3, 4]]])
    np.testing.assert_array_equal(at, np.eye(4))


def test_a_capsule_has_a_ball_at_each_end_of_its_cylinder():
    (middle, turned), *ends = drawing(p.GEOM_CAPSULE, (0.2, 0.04, 0.0), "", {})
    assert (middle.height, middle.radiusTop, middle.radiusBottom) == (0.2, 0.04, 0.04)
    assert turned @ (0, 1, 0, 0) == pytest.approx((0, 0, 1, 0))  # meshcat's lie along y
    assert [ball.radius for ball, _ in ends] == [0.04, 0.04]
    for (_, at), z in zip(ends, (-0.1, 0.1), strict=True):
        assert at[:3, 3] == pytest.approx((0, 0, z))


def test_a_shape_it_cannot_draw_is_named():
    with pytest.raises(ValueError, match=f"cannot draw a shape of PyBullet's type {p.GEOM_PLANE}"):
        drawing(p.GEOM_PLANE, (1.0, 1.0, 1.0), "", {})


def test_the_page_shows_the_scene_alone(client):
    """meshcat's own grid would lie in the table's top."""
    primitives(client)
    told = commands(Recorder(client).html("x"))
    hidden = {c["path"] for c in told if c.get("property") == "visible" and c["value"] is False}
    assert hidden == {"/Grid", "/Axes"}


def test_nothing_listens_and_nothing_is_started(client, monkeypatch):
    def refuse(*args, **kwargs):
        raise AssertionError("a socket or a process")

    for name in ("bind", "listen", "connect"):
        monkeypatch.setattr(socket.socket, name, refuse)
    monkeypatch.setattr("subprocess.Popen.__init__", refuse)
    monkeypatch.setattr("zmq.Context.socket", refuse)
    primitives(client)
    assert "MeshCat.Viewer" in Recorder(client).html("x")


def test_the_page_needs_nothing_else_and_stays_small(client, tmp_path):
    body = low_poly_panda(client, tmp_path)
    recorder, rng = Recorder(client), np.random.default_rng(3)
    for _ in range(300):  # the longest horizon of the tasks
        shake(client, body, rng)
        recorder.snap()
    page = recorder.html("a <b> & c")
    assert len(page) < 2e6
    assert not re.search(r"<(?:script|link|img|iframe)[^>]*\b(?:src|href)=", page)
    assert "<title>a &lt;b&gt; &amp; c</title>" in page
    assert str(tmp_path) not in page and "pybullet_data" not in page


def test_the_animation_repeats_for_ever_at_the_frame_rate_asked_for(client):
    body = primitives(client)
    recorder = Recorder(client)
    for x in range(3):
        p.resetBasePositionAndOrientation(body, (x, 0, 0), (0, 0, 0, 1), client)
        recorder.snap()
    (animation,) = [c for c in commands(recorder.html("x", fps=10)) if c["type"] == "set_animation"]
    assert animation["options"] == {"play": True, "repetitions": float("inf")}
    clip = animation["animations"][0]["clip"]
    # three frames, then a second's rest
    assert clip["fps"] == 10 and [k["time"] for k in clip["tracks"][0]["keys"]] == [0, 1, 2, 12]


def test_what_turns_on_the_spot_is_animated_at_25_frames_a_second_unless_asked(client, tmp_path):
    look = p.createVisualShape(p.GEOM_BOX, halfExtents=[0.1] * 3, physicsClientId=client)
    body = p.createMultiBody(1, -1, look, physicsClientId=client)
    recorder = Recorder(client)
    for turn in ((0, 0, 0, 1), (0, 0, 0.6, 0.8)):
        p.resetBasePositionAndOrientation(body, (0, 0, 0), turn, client)
        recorder.snap()
    told = commands(recorder.html("x"))
    ((part,),) = (c["animations"] for c in told if c["type"] == "set_animation")
    assert part["path"].endswith(f"/{body}/-1") and part["clip"]["fps"] == 25
    recorder.save(tmp_path / "a.html", "a title", fps=10)
    assert (tmp_path / "a.html").read_text() == recorder.html("a title", fps=10)
    recorder.save(tmp_path / "b.html")
    assert "<title>PyBullet scene</title>" in (tmp_path / "b.html").read_text()


def test_only_the_bodies_asked_for_are_recorded(client):
    first, second = primitives(client), primitives(client)
    assert {body for body, _ in Recorder(client, [second]).links} == {second} != {first}


def test_what_does_not_move_is_not_animated(client):
    primitives(client)
    recorder = Recorder(client)
    recorder.snap()
    recorder.snap()
    assert "set_animation" not in [c["type"] for c in commands(recorder.html("x"))]


def test_a_snap_costs_little(client, tmp_path):
    low_poly_panda(client, tmp_path)
    recorder = Recorder(client)
    start = time.perf_counter()
    for _ in range(50):
        recorder.snap()
    assert (time.perf_counter() - start) / 50 < 0.01  # s; a control step takes 0.04


def test_a_pages_ids_tell_nothing_of_the_computer(client):
    """meshcat's own are uuid1, which holds the network address."""
    primitives(client)
    page = Recorder(client).html("x")
    assert page == Recorder(client).html("x")


def test_on_paper_a_notebook_shows_a_picture_of_the_scene():
    client = p.connect(p.DIRECT)
    primitives(client)
    recorder = Recorder(client)
    recorder.target = 0.2, 0.1, 0.8
    shown = recorder._repr_html_()
    (png,) = re.findall(r'<img [^>]*src="data:image/png;base64,([^"]+)"', shown)
    picture = cv2.imdecode(np.frombuffer(base64.b64decode(png), np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (360, 640, 3)
    blue, _, red = picture.reshape(-1, 3).T.astype(int)
    assert (red - blue > 50).mean() > 0.01  # the red box
    assert "<iframe title=" in shown and "@media print { iframe { display: none } }" in shown
    p.disconnect(client)  # nothing is left to take a picture of, the recording is
    assert "<iframe" in recorder._repr_html_() and "<img" not in recorder._repr_html_()


@pytest.fixture(scope="module")
def mirrored():
    """All tasks' scenes, mirrored."""
    envs = {(name, arm): bare(name, embodiment=arm) for name in TASKS for arm in ("robot", "human")}
    for env in envs.values():
        env.reset(seed=0)
    yield {which: (env, mirror(env)) for which, env in envs.items()}
    for env in envs.values():
        env.close()


def test_one_sees_the_whole_arm_and_no_more_than_that_takes(mirrored):
    """In angles up and to the side from where one looks from; the picture is 16 to 9."""
    highest = widest = 0.0
    for env, scene in mirrored.values():
        ahead, side, up = basis(scene.eye, scene.target)
        arm, pybullet = env.arm, env.world.p
        points = [
            *(pybullet.getLinkState(arm.body, i, computeForwardKinematics=True)[4]
              for i in arm.links.values()),
            *(env.object_position(), env.target_position(), *env.WORKSPACE),
        ]  # fmt: skip
        seen = np.array(points) - scene.eye
        highest = max(highest, np.degrees(np.arctan(abs(seen @ up) / (seen @ ahead))).max())
        widest = max(widest, (abs(seen @ side) / (seen @ ahead)).max())
    assert 0.8 * FOV / 2 < highest < FOV / 2
    assert widest < 16 / 9 * np.tan(np.radians(FOV / 2))


def basis(eye, target):
    """Unit vectors ahead, to the right and up of one who looks from `eye` at `target`."""
    ahead = np.subtract(target, eye)
    side = np.cross(ahead, (0, 0, 1))
    return [v / np.linalg.norm(v) for v in (ahead, side, np.cross(side, ahead))]


def test_one_stands_as_far_off_and_as_far_aside_as_the_tasks_camera(mirrored):
    """Slide's camera, 1.58 m off and at 0.71 m along x; the others', 1.15 m and 0.56 m."""
    for (name, _), (_, scene) in mirrored.items():
        wider, aside = (1.58 / 1.15, 0.15) if name == "slide" else (1, 0)
        eye = 0.5 + aside, -1.2 * wider, 0.45 * wider
        assert scene.eye == pytest.approx(eye)
        assert scene.target == pytest.approx((0.42 + aside, 0, 0.22))


def test_a_mirrored_scenery_is_hidden_again_from_the_tasks_camera(mirrored):
    for env, scene in mirrored.values():
        p = env.world.p
        assert all(p.getVisualShapeData(body)[0][7][3] == 0 for body in env.world.scenery)
        still = {scene.links[row] for row, *_, rgba in scene.shapes if rgba[3] == 1}
        assert {(body, -1) for body in env.world.scenery} <= still  # and seen in the page


def test_a_page_writes_its_numbers_in_four_bytes():
    """To 0.1 micrometre; in eight a page of 300 frames would be half as large again."""
    told = pack(SimpleNamespace(lower=lambda: {"x": 0.3}))
    assert len(told) == len(umsgpack.packb({"x": 0.0}, force_float_precision="single"))
    assert umsgpack.unpackb(told)["x"] == pytest.approx(0.3, abs=1e-7)


def test_the_page_looks_from_where_the_picture_does_with_its_y_axis_up(mirrored):
    _, scene = mirrored["slide", "robot"]
    page = scene.html("x")
    for what, (x, y, z) in (("camera.position", scene.eye), ("controls.target", scene.target)):
        (told,) = re.findall(rf"viewer\.{what}\.set\((.*?)\)", page)
        assert [float(n) for n in told.split(",")] == pytest.approx([x, z, -y])
    assert f"half = {FOV} * Math.PI / 360" in page


def test_a_picture_of_a_tasks_scene_shows_its_table_and_leaves_it_as_it_was(mirrored):
    """The table's brown is seen about the picture's middle, where the target of the eye is."""
    env, scene = mirrored["push", "human"]
    before = env.world.render()
    picture = cv2.imdecode(np.frombuffer(scene.picture(), np.uint8), cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(env.world.render(), before)
    hidden = [env.world.p.getVisualShapeData(body)[0][7][3] for body in env.world.scenery]
    assert not any(hidden)
    red, blue = picture[240:, 200:440, 2].astype(int), picture[240:, 200:440, 0].astype(int)
    assert (red - blue > 25).mean() > 0.5
    paint = [material for *_, material in played(scene.html("x"), 0)]
    assert min(material["opacity"] for material in paint) == 1  # the page shows it, too


def test_stl_and_obj_give_the_same_triangles(tmp_path):
    corners = np.array(
        [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 1, 0], [-1, 0, 0]]], "<f4"
    )
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv -1 0 0\nf 1 2/1 3//1 -1\n")
    rows = b"".join(b"\0" * 12 + c.tobytes() + b"\0\0" for c in corners)
    (tmp_path / "a.stl").write_bytes(b" " * 80 + np.uint32(2).tobytes() + rows)
    np.testing.assert_array_equal(read_mesh(tmp_path / "a.stl"), corners)
    np.testing.assert_array_equal(read_mesh(tmp_path / "a.obj"), corners)


@pytest.mark.parametrize(
    ("name", "data"), [("a.dae", b"<x/>"), ("a.stl", b"solid a\nendsolid"), ("b.stl", b"")]
)
def test_a_mesh_it_cannot_read_is_named(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(ValueError, match=name):
        read_mesh(tmp_path / name)


def test_files_from_elsewhere_are_read(tmp_path):
    """A comment in Latin 1, capitals, a colour to each vertex, and other numbers for textures."""
    rows = "v 0 0 0 1 1 1\nv 1 0 0 1 1 1\nv 0 1 0 1 1 1\nvt 0 0\nvn 0 0 1\nf 3/1/1 1/1/1 2/1/1\n"
    path = tmp_path / "A.OBJ"
    path.write_bytes("# für\n".encode("latin-1") + rows.encode())
    corners = [[[0, 1, 0], [0, 0, 0], [1, 0, 0]]]
    np.testing.assert_array_equal(read_mesh(path), corners)
    np.testing.assert_array_equal(read_obj(rows), corners)
    data = b"\0" * 12 + np.array(corners, "<f4").tobytes() + b"\0\0"
    (tmp_path / "A.STL").write_bytes(b" " * 80 + np.uint32(1).tobytes() + data)
    np.testing.assert_array_equal(read_mesh(tmp_path / "A.STL"), corners)


def test_a_round_surface_bends_by_less_than_40_degrees_and_large_faces_count_more():
    """A square metre that lies, and half of one that is bent up by 39 or 41 degrees."""
    for bend, smooth in ((39, True), (41, False)):
        c, s = np.cos(np.radians(bend)), np.sin(np.radians(bend))
        left = [[0, 0, 0], [0, 1, 0], [-2, 0, 0]]
        right = [[0, 0, 0], [c, 0, s], [0, 1, 0]]
        n = normals(np.array([left, right], float))
        mean = 2 * np.array([0, 0, 1.0]) + (-s, 0, c) if smooth else np.array([0, 0, 1.0])
        np.testing.assert_allclose(n[0, :2], [mean / np.linalg.norm(mean)] * 2, atol=1e-9)
        np.testing.assert_allclose(n[0, 2], (0, 0, 1), atol=1e-9)  # where nothing is bent


def test_corners_a_thousandth_apart_are_two():
    """Of a thing of 1 m; each keeps the direction of its own face."""
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    tilted = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.3]]) + (0, 0, 0.001)
    n = normals(np.array([flat, tilted]))
    np.testing.assert_allclose(n[0], [(0, 0, 1)] * 3, atol=1e-9)


def test_edges_are_shaded_sharp_and_round_surfaces_round():
    a = np.radians(20)  # two squares' halves that meet along y: bent by 20 degrees, then by 90
    for bend, same in ((a, True), (np.pi / 2, False)):
        left = [[-1, 0, 0], [0, 0, 0], [0, 1, 0]]
        right = [[0, 1, 0], [0, 0, 0], [np.cos(bend), 0, np.sin(bend)]]
        corners = np.array([left, right], float)
        n = normals(corners)
        assert np.allclose(n[0, 1], n[1, 1]) == same
        small_and_far = 0.001 * corners + (1000, 0, 0)
        np.testing.assert_allclose(normals(small_and_far), n, atol=1e-6)
    np.testing.assert_allclose(n[0], [[0, 0, 1]] * 3, atol=1e-12)


VIEW = """
(() => {
  viewer.render();
  const foot = viewer.camera.position.clone().set(0, 0, 0).project(viewer.camera);
  return [viewer.camera.fov, foot.x];
})()
"""
ON_PAPER = """
(() => {
  dispatchEvent(new Event("beforeprint"));
  const paper = document.getElementById("paper");
  const {data} = paper.getContext("2d").getImageData(0, 0, paper.width, paper.height);
  const all = [...Array(data.length / 4).keys()].map(i => [...data.slice(4 * i, 4 * i + 3)]);
  return [paper.width, all.filter(([r, g, b]) => r > 150 && g < 60 && b < 60).length];
})()
"""
SHOWN = '["scene", "paper"].map(id => getComputedStyle(document.getElementById(id)))'
SHOWN += ".map(style => style.display !== 'none' && style.visibility !== 'hidden')"


async def look(folder):
    """The camera's angle and where it sees the foot of the arm, wide and upright; then on paper."""
    seen, flags = {}, ("--hide-scrollbars", "--enable-unsafe-swiftshader")
    async with browser.opened(folder / "scene.html", folder / "profile", *flags) as page:
        for width, height in ((1400, 900), (390, 844)):
            size = {"width": width, "height": height, "deviceScaleFactor": 1}
            await page.call("Emulation.setDeviceMetricsOverride", mobile=False, **size)
            await page.until("innerWidth", width)
            await asyncio.sleep(0.5)  # until the viewer has taken the new size
            seen[width] = await page.js(VIEW)
        seen["paper"] = await page.js(ON_PAPER)
        seen["screen"] = await page.js(SHOWN)
        await page.call("Emulation.setEmulatedMedia", media="print")
        seen["print"] = await page.js(SHOWN)
    return seen


def test_a_scene_is_whole_upright_on_a_phone_and_a_picture_on_paper(tmp_path_factory):
    def write(folder):
        env = tasks.bare("push")
        env.reset(seed=0)
        mirror(env).save(folder / "scene.html")
        env.close()

    seen = browser.seen(tmp_path_factory, write, look)
    assert seen[1400][0] == pytest.approx(FOV) and seen[390][0] > FOV
    assert -0.9 < seen[1400][1] < -0.4 and -0.9 < seen[390][1] < -0.4  # -1 is the left edge
    width, red = seen["paper"]  # the cube's pixels
    assert width == 390 and 100 < red < 1000
    assert seen["screen"] == [True, False] and seen["print"] == [False, True]
