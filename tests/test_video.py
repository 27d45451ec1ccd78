"""Video files: what goes wrong gets one sentence, what goes right keeps its frames and its time,
and writing is atomic. What files people bring is in test_clip.py and test_decoding.py."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from lbw_minimal import video
from lbw_minimal.clips import motion
from lbw_minimal.training import InputError

SHIPPED = Path(__file__).resolve().parent.parent / "tasks" / "videos"


def room(size=84, seed=0):
    """A still picture (size, size, 3) with edges in all directions: a room seen by a camera."""
    picture = np.full((size, size, 3), 120, np.uint8)
    rng = np.random.default_rng(seed)
    for _ in range(25):
        low, colour = rng.integers(0, size, 2), rng.integers(40, 200, 3).tolist()
        high = low + rng.integers(size // 10, size // 4, 2)
        cv2.rectangle(picture, low.tolist(), high.tolist(), colour, -1)
    return picture


def arm_moves(frames):
    """The same frames with an arm that comes in from the left, a third of the picture wide at the
    end."""
    frames = np.array(frames)
    n, size = len(frames), frames.shape[1]
    for t in range(n):
        frames[t, size // 2 : 2 * size // 3, : size * (t + 1) // (3 * n)] = (220, 170, 140)
    return frames


def film(n=30, size=84):
    return arm_moves(np.repeat(room(size)[None], n, axis=0))


def encode(path, frames, codec="mp4v", fps=25):
    """Frames as OpenCV writes them, without anything of `video.write`."""
    h, w = frames[0].shape[:2]
    out = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter_fourcc(*codec), fps, (w, h))
    for frame in frames:
        out.write(np.ascontiguousarray(frame[..., ::-1]))
    out.release()
    return path.read_bytes()


BAD = {
    "missing": (lambda path: None, "there is no such file; check the path"),
    "20x20": (
        lambda path: encode(path, film(30, 20)),
        "20x20 pixels are too few; give a video of 84x84 or",
    ),
    "no motion": (
        lambda path: encode(path, [room()] * 30),
        "nothing moves in the video; give one in which",
    ),
}


@pytest.mark.parametrize("make, sentence", BAD.values(), ids=BAD.keys())
def test_bad_file_gets_one_sentence_with_its_name_and_the_remedy(tmp_path, capfd, make, sentence):
    path = tmp_path / "mine.mp4"
    make(path)
    before = sorted(tmp_path.rglob("*"))
    capfd.readouterr()
    with pytest.raises(InputError, match=rf"^{path}: .*{sentence}[^\n]*\.$"):
        video.read(path)
    assert sorted(tmp_path.rglob("*")) == before
    assert capfd.readouterr() == ("", "")  # FFmpeg and OpenCV have nothing to add


def shaken(frames, pixels):
    """The inner 84x84 of larger frames, seen by a camera that wanders by that many pixels to each
    side."""
    margin = (frames.shape[1] - 84) // 2
    wander = np.rint(margin + pixels * np.sin(np.arange(len(frames))[:, None] * (0.5, 0.4))).astype(
        int
    )
    return np.stack([f[y : y + 84, x : x + 84] for f, (x, y) in zip(frames, wander, strict=True)])


def warnings_about(path, frames):
    video.write(path, frames, 25)
    return video.read(path)[1]


def test_shaken_camera_is_warned_of(tmp_path):
    (warning,) = warnings_about(tmp_path / "mine.mp4", shaken(film(30, 100), pixels=4))
    assert (
        warning.startswith(str(tmp_path / "mine.mp4"))
        and "camera seems to move; put it on a stand" in warning
    )


def test_panned_camera_is_warned_of(tmp_path):
    wide = film(30, 100)
    assert warnings_about(
        tmp_path / "mine.mp4", [f[8:92, t // 3 : t // 3 + 84] for t, f in enumerate(wide)]
    )


def test_arm_before_a_steady_camera_is_not_warned_of(tmp_path):
    assert warnings_about(tmp_path / "mine.mp4", shaken(film(30, 100), pixels=0)) == []


def test_noise_and_changing_light_are_not_taken_for_a_moving_camera(tmp_path):
    noise = np.random.default_rng(0).normal(0, 8, (30, 84, 84, 3))
    light = 1 + 0.15 * np.sin(np.arange(30) / 5).reshape(30, 1, 1, 1)
    encode(tmp_path / "mine.mp4", np.clip(film() * light + noise, 0, 255).astype(np.uint8))
    assert video.read(tmp_path / "mine.mp4")[1] == []


def test_noise_is_not_taken_for_motion(tmp_path):
    noise = np.random.default_rng(0).normal(0, 16, (30, 84, 84, 3))
    encode(tmp_path / "mine.mp4", np.clip(room() + noise, 0, 255).astype(np.uint8))
    with pytest.raises(InputError, match="nothing moves"):
        video.read(tmp_path / "mine.mp4")


def by_opencv(path):
    """Every frame, shrunk as those that the shipped weights were trained on."""
    shown, frames = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG), []
    while (got := shown.read())[0]:
        frames.append(cv2.resize(got[1], (84, 84), interpolation=cv2.INTER_AREA)[..., ::-1])
    return np.stack(frames)


# Of each task the random motion and two experts, all with `make slow`.
SOME = ("random", "expert_01", "expert_15")
FILES = [
    pytest.param(path, marks=[] if path.stem in SOME else pytest.mark.slow)
    for path in sorted(SHIPPED.glob("*/*.mp4"))
]


@pytest.mark.parametrize("path", FILES, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_shipped_video_passes_bit_for_bit_without_a_warning(path):
    frames, warnings = video.read(path, whole=path.stem == "random")
    assert frames.shape[1:] == (84, 84, 3) and warnings == []
    assert np.array_equal(frames, by_opencv(path))


def test_shipped_videos_take_less_than_a_megabyte_a_task():
    tasks = len(list(SHIPPED.glob("*/random.mp4")))
    assert sum(path.stat().st_size for path in SHIPPED.glob("*/*.mp4")) < 1e6 * tasks


def test_frames_written_come_back_in_number_rate_and_looks(tmp_path):
    frames = film(25)
    video.write(tmp_path / "mine.mp4", frames, 12.5)
    back, warnings = video.read(tmp_path / "mine.mp4")
    assert back.shape == (49, 84, 84, 3) and back.dtype == np.uint8 and warnings == []
    back = back[::2]  # each stands for two of 25 frames a second
    assert cv2.VideoCapture(str(tmp_path / "mine.mp4")).get(cv2.CAP_PROP_FPS) == 12.5
    error = (back.astype(float) - frames) ** 2
    # dB; measured 39.3, and 29.7 if written unenlarged
    assert 10 * np.log10(255**2 / error.mean()) > 37


def test_red_stays_red(tmp_path):
    frames = film()
    frames[:, :40] = (200, 30, 60)
    video.write(tmp_path / "mine.mp4", frames, 25)
    back, _ = video.read(tmp_path / "mine.mp4")
    assert np.abs(back[:, 5:35].mean(axis=(0, 1, 2)) - (200, 30, 60)).max() < 6


def test_reading_twice_gives_identical_frames(tmp_path):
    video.write(tmp_path / "mine.mp4", film(), 25)
    assert np.array_equal(
        video.read(tmp_path / "mine.mp4")[0], video.read(tmp_path / "mine.mp4")[0]
    )


def test_a_pixel_is_the_mean_of_all_that_it_stands_for():
    """Four columns to one, and only the first of four is white."""
    frame = np.zeros((336, 336, 3), np.uint8)
    frame[:, ::4] = 255
    assert np.abs(video._square(frame, "x").astype(int) - 64).max() <= 1


@pytest.mark.parametrize(("height", "width"), [(84, 200), (200, 84)])
def test_central_square_is_kept(height, width, tmp_path):
    """What is beside it is no border: those are black, and cut off before."""
    large = np.full((30, height, width, 3), 90, np.uint8)
    top, left = (height - 84) // 2, (width - 84) // 2
    large[:, top : top + 84, left : left + 84] = film()
    encode(tmp_path / "mine.mp4", large)
    back, _ = video.read(tmp_path / "mine.mp4")
    assert np.abs(back.astype(float) - film()).mean() < 10


def test_4k_video_is_shrunk_to_what_it_shows(tmp_path):
    small = film(4)
    encode(
        tmp_path / "mine.mp4",
        [cv2.resize(f, (3840, 2160), interpolation=cv2.INTER_AREA) for f in small],
    )
    frames, warnings = video.read(tmp_path / "mine.mp4")
    assert frames.shape == (4, 84, 84, 3) and warnings == []


def test_long_video_is_thinned_evenly_and_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(video, "MAX_FRAMES", 10)
    video.write(tmp_path / "mine.mp4", film(35), 25)
    frames, warnings = video.read(tmp_path / "mine.mp4")
    assert len(frames) == 9 and np.abs(frames.astype(float) - film(35)[::4]).mean() < 5
    assert "35 frames are many; one in 4 is used, 9 in all." in warnings[0]


@pytest.mark.parametrize("fps", [10, 60])
def test_a_motion_takes_25_frames_a_second_whatever_the_video_has(tmp_path, fps):
    encode(tmp_path / "mine.mp4", film(fps + 1), fps=fps)
    frames, warnings = video.read(tmp_path / "mine.mp4")
    assert len(frames) == 26 and warnings == []


def test_of_a_loop_that_starts_in_the_middle_the_longest_piece_is_used(tmp_path):
    frames = film(40)
    video.write(tmp_path / "mine.mp4", np.concatenate([frames[15:], frames[:15]]), 25)
    piece, (warning,) = video.read(tmp_path / "mine.mp4")
    assert np.abs(piece.astype(float) - frames[15:]).mean() < 5
    assert "it jumps at 1.0 s; the longest of 2 pieces is used, 1.0 of 1.6 s." in warning
    everything, warnings = video.read(tmp_path / "mine.mp4", whole=True)
    assert len(everything) == 40 and warnings == []


def test_a_film_that_is_taken_whole_is_not_searched_for_cuts(monkeypatch):
    """The search takes two thirds of the time."""
    monkeypatch.setattr(motion, "jumps", lambda *_: pytest.fail("searched"))
    assert len(video.read(SHIPPED / "push" / "random.mp4", whole=True)[0]) == 351


def test_steadiness_by_hand():
    """On a ramp of 4 levels a pixel 3.9 levels are less than a pixel, and 4.1 are more.

    The steadiest two fifths count. What is flatter than 3 levels a pixel is no edge.
    """
    x = np.arange(20, dtype=np.float32)
    ramp, flat = np.tile(4 * x, (20, 1)), np.tile(2.9 * x, (20, 1))
    stays, goes = ramp + 3.9, ramp + 4.1
    assert video.steadiness(np.stack([stays, stays, stays, goes]), ramp) == 0.75
    for rows, steady in ((11, 1), (13, 0)):
        part = stays.copy()
        part[:rows] = goes[:rows]
        assert video.steadiness(part[None], ramp) == steady
    assert video.steadiness(flat[None] + 50, flat) == 1
    assert video.steadiness(flat[None] * 1.1 + 50, flat * 1.1) == 0


def test_enlarged_film_for_a_report_shows_the_same(tmp_path):
    video.write(tmp_path / "mine.mp4", film(), 25, scale=4)
    assert cv2.VideoCapture(str(tmp_path / "mine.mp4")).get(cv2.CAP_PROP_FRAME_WIDTH) == 336
    assert np.abs(video.read(tmp_path / "mine.mp4")[0].astype(float) - film()).mean() < 5


def dies_midway():
    yield from film()[:10]
    raise RuntimeError("the simulator died")


def test_failure_midway_leaves_no_file(tmp_path):
    with pytest.raises(RuntimeError, match="the simulator died"):
        video.write(tmp_path / "mine.mp4", dies_midway(), 25)
    assert list(tmp_path.iterdir()) == []


def test_failure_midway_leaves_the_old_file(tmp_path):
    video.write(tmp_path / "mine.mp4", film(), 25)
    old = (tmp_path / "mine.mp4").read_bytes()
    with pytest.raises(RuntimeError):
        video.write(tmp_path / "mine.mp4", dies_midway(), 25)
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [old]


def test_no_frames_write_no_file(tmp_path):
    with pytest.raises(InputError, match=r"mine\.mp4: there are no frames to write"):
        video.write(tmp_path / "mine.mp4", [], 25)
    assert list(tmp_path.iterdir()) == []


# What it says and asks for, to the letter ---------------------------------------------------------


def clip_of(frames, fps=25, cuts=(), losses=()):
    """A clip as `read_clip` gives it."""
    from lbw_minimal.clips.reader import Clip

    known = {"frames": frames, "times": np.arange(len(frames)) / fps, "cuts": list(cuts)}
    fields = {name: known.get(name, []) for name in Clip.__annotations__}
    return Clip(**fields | {"losses": list(losses)})


def test_all_that_is_odd_about_a_video_is_told_in_order(tmp_path, monkeypatch):
    """Losses, the first five of its cuts, too many frames, a camera that moves."""
    frames = film(36, 100)
    shake = np.random.default_rng(0).integers(-3, 4, len(frames))
    for i, by in enumerate(shake):
        frames[i] = np.roll(frames[i], by, axis=1)
    cuts, asked = [4, 8, 12, 15, 18, 21], []

    def read_clip(path, cuts_wanted=None, **options):
        asked.append((path, options))
        return clip_of(frames, cuts=cuts, losses=["it lost a thing."])

    monkeypatch.setattr(video, "read_clip", read_clip)
    monkeypatch.setattr(video, "MAX_FRAMES", 7)
    monkeypatch.setattr(video, "steady", lambda clip: clip_of(frames[21:]))
    found, told = video.read("my.mp4")
    assert len(found) == 5 and asked == [("my.mp4", {"cuts": True})]
    assert told == [
        "my.mp4: it lost a thing.",
        "my.mp4: it jumps at 0.2 s, 0.3 s, 0.5 s, 0.6 s, 0.7 s; the longest of 7 pieces is used, "
        "0.6 of 1.4 s.",
        "my.mp4: 15 frames are many; one in 3 is used, 5 in all.",
        "my.mp4: the camera seems to move; put it on a stand, or keypoints will follow it.",
    ]
    video.read("my.mp4", whole=True)
    assert asked[1] == ("my.mp4", {"cuts": False})


def test_frames_are_taken_as_they_were(tmp_path, monkeypatch, golden):
    """Of a high and a wide clip of 40 frames a second: which, and what is at which place."""
    figures = {}
    for name, (h, w) in {"high": (231, 101), "wide": (90, 187)}.items():
        side = np.arange(h)[:, None] * 0.5 + np.arange(w) * 0.7
        frames = np.repeat((side % 200)[None, ..., None], 50, axis=0) + [0.0, 20, 50]
        for t in range(50):
            frames[t, h // 3 : h // 2, : w // 3 + t] = 30 + 4 * t
        monkeypatch.setattr(
            video, "read_clip", lambda *_, f=frames, **__: clip_of(f.astype(np.uint8), fps=40)
        )
        monkeypatch.setattr(video, "MAX_FRAMES", 31)  # just as many are not too many
        found, _ = video.read("my.mp4")
        assert found.shape[1:] == (84, 84, 3) and found.dtype == np.uint8
        figures[f"{name}: frames"] = len(found)
        figures[f"{name}: by frame"] = found.mean((1, 2, 3))[::3].round(2)
        figures[f"{name}: by place"] = found[3].reshape(6, 14, 6, 14, 3).mean((1, 3))[::2, :, 0]
    golden(figures, atol=0.1)


@pytest.mark.parametrize(("height", "width", "read"), [(84, 252, True), (83, 252, False)])
def test_a_video_has_to_be_84_pixels_high(height, width, read, tmp_path):
    frame = np.zeros((height, width, 3), np.uint8)
    if read:
        assert video._square(frame, "my.mp4").shape == (84, 84, 3)
        return
    with pytest.raises(InputError) as told:
        video._square(frame, "my.mp4")
    assert str(told.value) == (
        "my.mp4: 252x83 pixels are too few; give a video of 84x84 or more, at most three times as "
        "wide as high."
    )


def test_more_than_2000_frames_are_many():
    """As long as a minute and twenty seconds is not, and the paper's videos are shorter."""
    assert video.MAX_FRAMES == 80 * 25 and video.SIZE == 84


def test_a_room_stays_where_87_of_100_frames_say_so(monkeypatch):
    monkeypatch.setattr(video, "read_clip", lambda *_, **__: clip_of(film()))
    for share, warned in ((0.869, True), (0.871, False)):
        monkeypatch.setattr(video, "steadiness", lambda *_, share=share: share)
        assert bool(video.read("my.mp4")[1]) is warned


def test_steadiness_is_what_it_was(golden):
    """Of a room that is shaken in some frames, with an arm before it; edges of many slopes."""
    rng = np.random.default_rng(3)
    room_ = cv2.GaussianBlur(rng.uniform(0, 255, (60, 84)).astype(np.float32), (0, 0), 4) * 3
    frames = np.repeat(room_[None], 12, axis=0) + rng.normal(size=(12, 60, 84)).astype(np.float32)
    figures = {"still": video.steadiness(frames, room_)}
    for by, axis in ((1, 0), (2, 1), (3, 1)):
        shaken_ = frames.copy()
        shaken_[4:7] = np.roll(shaken_[4:7], by, axis)
        shaken_[9, :, 30:] += 25
        figures[f"{by} along {axis}"] = video.steadiness(shaken_, room_)
    golden(figures)


def test_a_film_is_written_for_browsers_with_enlarged_pixels(tmp_path, monkeypatch):
    """VP9 by FFmpeg, the size that was asked for, blue first, each pixel as it is."""
    asked, kept = [], []

    class Writer:
        opens = True

        def __init__(self, *of):
            asked.append(of[1:])
            Path(of[0]).write_bytes(b"film")

        def isOpened(self):
            return self.opens

        def write(self, frame):
            kept.append(frame)

        def release(self):
            kept.append("released")

        fourcc = staticmethod(lambda *letters: "".join(letters))

    monkeypatch.setattr(video.cv2, "VideoWriter", Writer)
    frames = np.arange(2 * 3 * 4 * 3, dtype=np.uint8).reshape(2, 3, 4, 3)
    video.write(tmp_path / "a.mp4", frames, 12.5)
    assert asked == [(cv2.CAP_FFMPEG, "vp09", 12.5, (8, 6))]
    assert kept.pop() == "released" and (tmp_path / "a.mp4").read_bytes() == b"film"
    for frame, given in zip(kept, frames, strict=True):
        np.testing.assert_array_equal(frame, given[..., ::-1].repeat(2, 0).repeat(2, 1))
    Writer.opens = False
    with pytest.raises(RuntimeError) as told:
        video.write(tmp_path / "b.mp4", frames, 25, scale=3)
    assert str(told.value) == (
        "this OpenCV cannot write VP9; install the version in requirements.txt."
    )
    assert asked[1][-1] == (12, 9) and not (tmp_path / "b.mp4").exists()
