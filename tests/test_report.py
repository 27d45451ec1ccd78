"""The page of a run: complete, self-contained, small; its pictures right to the pixel."""

import base64
import io
import re
from dataclasses import fields
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from lbw_minimal import pictures, report
from lbw_minimal.imitate import Recipe
from lbw_minimal.report_texts import WORDS

T, N, K = 4, 9, 3
SCENE = (
    '<!DOCTYPE html><html><body><p title="a & b">scene</p>'
    "<script>'<b>' && 1</script></body></html>"
)


def frames(n):
    """A square that moves to the right on a plain table."""
    out = np.full((n, 84, 84, 3), 120, np.uint8)
    for i in range(n):
        out[i, 40:50, 5 + i : 15 + i] = (200, 30, 30)
    return out


def example():
    """What a run knows in the end."""
    z = np.random.default_rng(0).uniform(-1, 1, (N, K, 2))
    tip_x, object_y = {"r2": 0.987, "px": 0.42}, {"r2": None, "px": 0.1}
    return {
        "task": "push", "demo": frames(N), "translated": frames(N), "z_demo": z,
        "log": [{"step": 50 * i, "return": -1.0 * i, "success": i > 2} for i in range(1, 6)],
        "episode": {"frames": frames(T), "z": z[:T], "parts": [{"r1": -0.1, "r2": -0.2}] * T},
        "metrics": {
            "success": {"rate": 0.9, "low": 0.596, "high": 0.982, "episodes": 10},
            "episodes": [{"success": i != 3, "first_success": 2} for i in range(10)],
            "stages": {"translation": 600.0, "policy": 60.0},
            "perception": {
                "robot": {"tip_x": tip_x, "object_y": object_y}, "keypoint_std": [0.25, 0.1099999],
            },
            "settings": {"seed": 7, "reward": "literal", "recipe": {"K": 5}},
            "machine": "two cores",
        },
        "scene_html": SCENE, "command": "python -m tasks push --seed 7",
    }  # fmt: skip


def written(folder, run):
    report.write_report(folder / "report.html", **run)
    return (folder / "report.html").read_text()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("run")


@pytest.fixture(scope="module")
def page(folder):
    return written(folder, example())


@pytest.fixture
def run():
    """The demonstration alone, for tests of one part."""
    return {k: v for k, v in example().items() if k in ("task", "demo", "translated", "z_demo")}


def titles(page):
    return re.findall(r"<h2>(.*?)</h2>", page)


def test_wilson_gives_the_published_values():
    """By hand, z^2 = 3.8415. 10 of 10: n / (n + z^2); 5 of 10: 1/2 -+ z / (2 sqrt(n + z^2))."""
    np.testing.assert_allclose(report.wilson(10, 10), (10 / 13.8415, 1), atol=1e-5)
    np.testing.assert_allclose(report.wilson(5, 10), (0.236593, 0.763407), atol=1e-5)


def test_wilson_stays_a_share_where_rounding_would_not():
    assert all(report.wilson(0, n)[0] >= 0 and report.wilson(n, n)[1] <= 1 for n in range(1, 400))


def test_times_are_added_up():
    page = "".join(report.figures({"stages": {"one": 60.0, "two": 120.0}}))
    assert re.findall(r"together.*?(3\.0 min)", page, re.S) == ["3.0 min"]


def test_wilson_is_symmetric():
    low, high = report.wilson(2, 13)
    assert report.wilson(11, 13) == pytest.approx((1 - high, 1 - low))


@pytest.mark.parametrize(("wins", "n"), [(0, 0), (3, 2), (-1, 5)])
def test_wilson_refuses_impossible_counts(wins, n):
    with pytest.raises(ValueError, match="successes"):
        report.wilson(wins, n)


def test_a_keypoint_is_drawn_on_the_pixel_it_names():
    """z = (-1 + 2 (20.5) / 84, ...) is the centre of pixel 20: columns 80 to 83 when enlarged."""
    z = np.array([[[2 * 20.5 / 84 - 1, 2 * 60.5 / 84 - 1]]])
    image = pictures.draw_keypoints(np.zeros((1, 84, 84, 3), np.uint8), z, scale=3)[0]
    rows, columns = np.nonzero(image.any(-1))
    assert abs(columns.mean() - 61) < 0.1 and abs(rows.mean() - 181) < 0.1
    assert tuple(image[181, 61]) == pictures.colour(0)


def test_drawing_leaves_the_frames_alone():
    frames = np.zeros((2, 84, 84, 3), np.uint8)
    pictures.draw_keypoints(frames, np.zeros((2, K, 2)), scale=1)
    assert not frames.any()


def test_a_keypoint_outside_the_image_is_no_error():
    image = pictures.draw_keypoints(np.zeros((1, 84, 84, 3), np.uint8), np.full((1, 1, 2), 1.5))
    assert not image.any()


def test_a_strip_shows_first_and_last_frame():
    frames = np.arange(20, dtype=np.uint8)[:, None, None, None] * np.ones((84, 84, 3), np.uint8)
    image = pictures.strip(frames, n=4, scale=2)
    assert image.shape == (168, 4 * 168, 3)
    assert [image[0, 168 * i, 0] for i in range(4)] == [0, 6, 13, 19]


def test_a_video_shorter_than_the_strip_shows_each_frame_once():
    assert pictures.strip(np.zeros((3, 84, 84, 3), np.uint8), n=8, scale=1).shape == (84, 3 * 84, 3)


def test_the_curve_shows_the_mean_of_the_last_episodes():
    log = [{"step": 50 * i, "return": -i, "success": i % 2 == 0} for i in range(1, 5)]
    above, below = pictures.curve(log, last=2).axes
    np.testing.assert_allclose(above.lines[1].get_ydata(), [0, 0.5, 0.5, 0.5])
    np.testing.assert_allclose(below.lines[1].get_ydata(), [-1, -1.5, -2.5, -3.5])


def test_down_is_down_in_the_plots_of_keypoints():
    z = np.zeros((4, K, 2))
    for axis in (pictures.paths(z, z).axes[0], pictures.courses(z, z).axes[1]):
        top, bottom = axis.get_ylim()[::-1]
        assert top < bottom


def test_the_picture_behind_the_paths_is_as_the_camera_saw_it():
    """Its first row at y = -1, the top; and each path runs through its keypoints."""
    z = np.stack([np.linspace([-0.5, 0.2], [0.5, -0.4], 4), np.zeros((4, 2))], 1)
    axis = pictures.paths(z + 0.1, z, np.zeros((84, 84, 3), np.uint8)).axes[0]
    assert list(axis.images[0].get_extent()) == [-1, 1, 1, -1] and axis.images[0].origin == "upper"
    shown, own = (line.get_xydata() for line in axis.lines[:2])
    np.testing.assert_allclose(shown, z[:, 0] + 0.1)
    np.testing.assert_allclose(own, z[:, 0])
    start, end = (line.get_xydata()[0] for line in axis.lines[2:4])
    np.testing.assert_allclose([start, end], z[[0, -1], 0])


def test_courses_run_over_the_share_of_each_video():
    z_demo, z = np.zeros((5, 1, 2)), np.zeros((3, 1, 2))
    z_demo[:, 0, 0], z[:, 0, 1] = np.arange(5), np.arange(3)
    x, y = pictures.courses(z_demo, z).axes
    np.testing.assert_allclose(
        x.lines[0].get_xydata(), np.stack([np.arange(5) / 4, np.arange(5)], 1)
    )
    np.testing.assert_allclose(y.lines[1].get_xydata(), [[0, 0], [0.5, 1], [1, 2]])


def test_parts_of_the_reward_come_after_their_steps_and_0_is_at_the_top():
    rows = [{"r1": -1.0, "r2": -2.0}, {"r1": -3.0, "r2": -0.5}]
    (axis,) = pictures.parts(rows, fps=25, success=2).axes
    np.testing.assert_allclose(axis.lines[0].get_xydata(), [[0.04, -1], [0.08, -3]])
    np.testing.assert_allclose(axis.lines[1].get_ydata(), [-2, -0.5])
    np.testing.assert_allclose(axis.lines[2].get_xdata(), 0.08)  # where the task was done
    assert axis.get_ylim()[1] >= 0
    axis.figure.canvas.draw()
    (said,) = axis.texts
    assert said.get_text() == "task done"
    assert not said.get_window_extent().overlaps(axis.get_window_extent())  # nor covers a curve


def test_columns_say_at_which_second_they_are_and_what_the_classifier_said():
    frames = np.zeros((50, 84, 84, 3), np.uint8)
    html = report.demonstration(frames, None, None, 25, np.arange(50) - 9.5)
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", html)
    assert len(captions) == 8 and captions[0] == "0.0 s, -9.5" and captions[-1] == "2.0 s, +39.5"


def test_digits_read_on_their_colours():
    """Black on yellow and orange, white on blue and black."""
    inks = {pictures.COLOURS[k]: pictures.ink(k)[0] for k in range(8)}
    assert inks["#F0E442"] == inks["#E69F00"] == 0 and inks["#0072B2"] == inks["#000000"] == 255


def plain(page):
    """The page without what keeps the words of a command whole."""
    return re.sub('<span class="word">(.*?)</span>', r"\1", page)


def test_the_page_has_every_section(page):
    assert len(titles(page)) == 11 and titles(page)[0] == "The method"
    assert (
        page.count("<img") == 1 + 8 + 1 + 2 + 1 + 1
    )  # method, columns, film, paths, curve, reward
    assert page.count("<video") == 1
    for text in ("9 of 10", "60-98 %", "11.0 min", "0.987 (0.4)", "python -m tasks push --seed 7",
                 "two cores", "(standard deviation)", "0.25, 0.11", "✓ ✓ ✓ ✗ ✓"):  # fmt: skip
        assert text in plain(page)


def test_pictures_keep_their_colours():
    red = np.zeros((2, 2, 3), np.uint8)
    red[..., 0] = 255
    data = base64.b64decode(pictures.png(red).split(",")[1])
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(data))), red)


class Outside(HTMLParser):
    """Collects what a page would load."""

    def __init__(self):
        super().__init__()
        self.loads = []

    def handle_starttag(self, tag, attributes):
        self.loads += [v for k, v in attributes if k in ("src", "href", "data", "poster", "srcset")]


def test_the_page_loads_nothing_from_elsewhere(page):
    parser = Outside()
    parser.feed(page)
    assert parser.loads and all(v.startswith("data:") for v in parser.loads)
    assert not re.search(r"https?://|url\(|@import", page)


def test_the_page_names_no_path_of_the_machine(page, folder):
    hidden = re.findall(r"base64,([^\"]*)", page)
    decoded = [base64.b64decode(d).decode(errors="ignore") for d in hidden]
    assert not [text for text in (page, *decoded) if str(folder) in text or "/lib/python" in text]


def test_the_same_run_gives_the_same_page(page, folder):
    """No date, no chance ids: two runs can be compared by their files."""
    assert written(folder, example()) == page


def test_the_scene_comes_through_unchanged(page):
    class Frame(HTMLParser):
        def handle_starttag(self, tag, attributes):
            if tag == "iframe":
                self.scene = dict(attributes)["srcdoc"]

    parser = Frame()
    parser.feed(page)
    assert parser.scene == SCENE


@pytest.mark.parametrize(
    ("part", "shown"),
    [
        ("log", ["How the robot learnt"]),
        ("scene_html", ["The same episode in three dimensions"]),
        ("command", ["To make this run again"]),
        ("metrics", ["Time", "Perception, measured", "Settings"]),
    ],
)
def test_each_part_is_shown_without_the_others(tmp_path, run, part, shown):
    assert titles(written(tmp_path, run | {part: example()[part]}))[1:] == shown


def test_the_demonstration_alone_makes_a_page(tmp_path, run):
    page = written(tmp_path, run)
    assert len(titles(page)) == 1 and "None" not in page


def test_observations_with_a_clock_serve_as_keypoints(page, tmp_path):
    run = example()
    z = run["episode"]["z"].reshape(T, -1)
    run["episode"]["z"] = np.concatenate([z, np.linspace(0, 1, T)[:, None]], axis=1)
    assert written(tmp_path, run) == page


def test_a_page_of_real_size_stays_small(tmp_path):
    """50 frames of an episode and the largest scene."""
    run = example() | {"scene_html": "x" * 2_000_000}
    run["episode"] |= {"frames": frames(50), "z": np.zeros((50, K, 2))}
    assert len(written(tmp_path, run).encode()) < 4e6


def test_a_smoke_run_says_so(tmp_path, page, run):
    assert "smoke run" not in page
    assert "smoke run" in written(tmp_path, run | {"metrics": {"settings": {"fast": True}}})


def test_settings_are_named_for_people_and_what_is_not_set_is_left_out():
    """A number keeps its value: 1 is no yes."""
    settings = {"task": "push", "without": None, "set": [], "fast": False, "from_scratch": True,
                "seed": 1, "recipe": {"K": 5, "updates": 1, "random_negatives": False}}  # fmt: skip
    rows = re.findall("<tr>(.*?)</tr>", "".join(report.figures({"settings": settings})))
    assert [re.findall("<td>(.*?)</td>", row) for row in rows] == [
        ["task", "push"], ["smoke run", "no"], ["perception trained in this run", "yes"],
        ["seed", "1"], ["keypoints", "K=5"],
        ["updates of the policy at each of them", "updates=1"],
        ["random motion is shown to it as no goal", "random_negatives=0"],
    ]  # fmt: skip


def test_every_number_of_a_recipe_has_words():
    assert {field.name for field in fields(Recipe)} <= set(WORDS)


def test_a_replay_claims_no_learning(tmp_path, run):
    """Of a replay's stages all is filming: no time of learning, no seed, no recipe."""
    settings = {"seed": 7, "method": "lbw", "recipe": {"policy_steps": 3000}}
    run |= {"metrics": {"stages": {"robot_video": 16.0}, "settings": settings}}
    page = written(tmp_path, run)
    assert "nothing was learnt in this run" in page
    assert "of learning" not in page and "<span>seed" not in page and "3000" not in page


@pytest.mark.parametrize(
    ("method", "stages", "said"),
    [
        ("lbw", ["policy"], "Learnt in this run: policy. The rest was trained before."),
        ("lbw", ["translation", "keypoints", "policy"], None),
        ("avid", ["classifier", "policy"], "Learnt in this run: classifier, policy."),
        ("classifier", ["classifier", "policy"], None),
    ],
)
def test_what_was_trained_before_is_told_from_what_was_learnt(tmp_path, run, method, stages, said):
    times = {"robot_video": 16.0} | dict.fromkeys(stages, 60.0)
    run |= {"metrics": {"stages": times, "settings": {"method": method}}}
    page = written(tmp_path, run)
    assert f"<b>{report.duration(60 * len(stages))}</b><span>of learning" in page
    assert said in page if said else "trained before" not in page
    assert 'class="note"' not in page  # which is for warnings


@pytest.mark.parametrize(
    ("n", "said"), [(1, "1 of 1 test episode succeeds"), (2, "2 of 2 test episodes succeed")]
)
def test_the_headline_counts_episodes_as_people_do(tmp_path, run, n, said):
    success = {"rate": 1.0, "low": 0.2, "high": 1.0, "episodes": n}
    assert f"<h1>Push: {said}</h1>" in written(tmp_path, run | {"metrics": {"success": success}})


def test_what_success_is_stands_below_the_figures(tmp_path, run):
    page = written(tmp_path, run | {"goal": "the cube gets < 5 cm near"})
    said = "<p>An episode is a success if the cube gets &lt; 5 cm near."
    assert page.index('<div class="tiles">') < page.index(said) < page.index("<h2>")
    assert "is a success if" not in written(tmp_path, run | {"goal": ""})


def test_text_of_the_run_cannot_break_the_page(tmp_path, run):
    run |= {"task": "<script>x", "command": "a & b < c"}
    run |= {"metrics": {"settings": {"video": '"><script>y'}}}
    page = written(tmp_path, run)
    assert "<script>x" not in page and "<script>y" not in page and "a &amp; b &lt; c" in plain(page)


def test_a_failure_on_the_way_leaves_the_old_page(tmp_path, run, monkeypatch):
    (tmp_path / "report.html").write_text("old")
    monkeypatch.setattr("os.replace", lambda *paths: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        written(tmp_path, run)
    assert (tmp_path / "report.html").read_text() == "old"


@pytest.mark.parametrize("method", ["lbw", "tracks"])
def test_a_persons_clip_comes_before_all_else_that_was_seen(tmp_path, run, method):
    stills = np.stack([np.full((252, 252, 3), 40 * k, np.uint8) for k in range(5)])
    run["metrics"] = {"settings": {"method": method}}
    page = written(tmp_path, run | {"clip": stills})
    assert titles(page)[:2] == ["Your clip", report.SHOWN[method]]
    part = page.partition("Your clip")[2].partition("<h2>")[0]
    images = re.findall(r'base64,([^"]+)" alt="Still (\d) of the clip"', part)
    shown = [np.asarray(Image.open(io.BytesIO(base64.b64decode(data)))) for data, _ in images]
    np.testing.assert_array_equal(shown, stills)
    assert [k for _, k in images] == list("12345")
    assert 'href="prepare.html"' in part
    run["metrics"]["clip"] = {"clip": "a <b>.mp4", "corrections": "", "command": ""}
    page = plain(written(tmp_path, run | {"clip": stills, "command": "run <it>"}))
    assert "<b>a &lt;b&gt;.mp4</b>, not corrected." in page and "<pre>run &lt;it&gt;</pre>" in page
    run["metrics"]["clip"] |= {"corrections": "--tip 3,4@1", "command": "prepare 'a <b>.mp4'"}
    page = plain(written(tmp_path, run | {"clip": stills, "command": "run <it>"}))
    assert "corrected by <code>--tip 3,4@1</code>." in page
    assert "<pre>prepare &#x27;a &lt;b&gt;.mp4&#x27;\nrun &lt;it&gt;</pre>" in page
    assert "Your clip" not in written(tmp_path, run)
