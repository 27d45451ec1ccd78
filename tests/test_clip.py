"""People's clips: whatever wrote the file, what it shows comes out upright, squared, in ordinary
colours and at its true time; what cannot be read gets one true sentence."""

import subprocess
import sys
from types import SimpleNamespace

import av
import cv2
import numpy as np
import pytest
from toy_clips import H, W, add, arm, encode, reach, room, shows

from lbw_minimal.clips import reader as clips
from lbw_minimal.clips.reader import read_clip, resample, steady
from lbw_minimal.training import InputError

KINDS = {
    "h264.mp4": ("libx264", None, {}),
    "hevc.mov": ("libx265", None, {"x265-params": "log-level=none"}),
    "av1.mp4": ("libsvtav1", None, {"preset": "12"}),
    "vp8.webm": ("libvpx", None, {"deadline": "realtime"}),
    "vp9.webm": ("libvpx-vp9", None, {"deadline": "realtime"}),
    "old.avi": ("mjpeg", "yuvj420p", {}),
    "mpeg4.3gp": ("mpeg4", None, {}),
    "camera.ts": ("mpeg2video", None, {}),
    "cut.mkv": ("ffv1", None, {}),
    "prores.mov": ("prores_ks", "yuv422p10le", {}),
    "moving.gif": ("gif", "rgb8", {}),
}


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_of_file_shows_what_was_filmed(tmp_path, name, capfd):
    codec, fmt, options = KINDS[name]
    path = encode(tmp_path / name, reach(), codec, fmt=fmt, options=options)
    capfd.readouterr()  # some encoders talk
    clip = read_clip(path)
    assert clip.frames.shape == (30, H, W, 3) and clip.frames.dtype == np.uint8
    assert shows(clip.frames, reach()) < (25 if "gif" in name else 8)
    np.testing.assert_allclose(clip.times, np.arange(30) / 25, atol=0.011)  # gif counts hundredths
    assert (clip.cuts, clip.notes, clip.losses) == ([], [], [])
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["12:30.mp4", "arm%03d.mp4", "mein Arm – ä é 手.mp4", "#1?.mp4"])
def test_a_name_is_only_a_name(tmp_path, monkeypatch, name):
    encode(tmp_path / "plain.mp4", reach(10))
    try:
        (tmp_path / "plain.mp4").rename(tmp_path / name)
    except OSError:
        pytest.skip("needs a system that has such names")
    monkeypatch.chdir(tmp_path)
    assert len(read_clip(name).frames) == 10


@pytest.mark.parametrize("rate", [10, 30, 60, 240])
def test_a_motion_of_one_second_takes_25_frames_at_any_rate(tmp_path, rate):
    clip = read_clip(encode(tmp_path / "a.mp4", reach(rate + 1), rate=rate))
    assert len(clip.frames) == rate + 1 and clip.times[-1] == pytest.approx(1, abs=1e-3)
    shown = clip.frames[resample(clip.times)]
    # Where the arm ends at each of 26 moments, to half a frame of the clip.
    assert len(shown) == 26
    off = shows(shown, arm(0.1 + 0.5 * np.rint(np.arange(26) / 25 * rate) / rate))
    assert off < 8 and clip.cuts == []


def test_variable_rates_keep_their_times(tmp_path):
    times = np.r_[0:10, 12:30:3] / 25  # from 25 frames a second to 8, as in low light
    path = encode(tmp_path / "a.mp4", arm(0.1 + 0.4 * times), times=times)
    np.testing.assert_allclose(read_clip(path).times, times, atol=1e-3)


def test_resampling_takes_the_nearest_frame_and_invents_none():
    assert resample(np.arange(4) / 25).tolist() == [0, 1, 2, 3]
    assert resample(np.array([0, 0.1, 0.2])).tolist() == [0, 0, 1, 1, 2, 2]
    assert resample(np.array([0.0, 0.3]), rate=10).tolist() == [0, 0, 1, 1]
    assert resample(np.arange(7) / 50).tolist() == [0, 2, 4, 6]
    assert resample(np.array([0, 0.08, 0.16])).tolist() == [0, 0, 1, 1, 2]  # halfway: the earlier


def test_slow_motion_that_says_so_is_played_at_true_speed(tmp_path):
    path = encode(
        tmp_path / "a.mp4", reach(61), rate=30, metadata={clips.CAPTURED: "240.0"},
        container={"movflags": "use_metadata_tags"},
    )  # fmt: skip
    clip = read_clip(path)
    assert clip.times[-1] == pytest.approx(60 / 240, abs=1e-3) and "Slow motion" in clip.notes[0]


def test_a_stream_without_time_stamps_takes_its_rate_and_says_so(tmp_path):
    path = encode(tmp_path / "raw.h264", reach(20), rate=25)
    clip = read_clip(path)
    np.testing.assert_allclose(clip.times, np.arange(20) / 25, atol=1e-6)


def test_frames_that_an_edit_list_hides_stay_hidden(tmp_path):
    """As lossless trimmers write it: coding begins at a key frame that is not to be shown."""
    encode(tmp_path / "a.mp4", reach(30), options={"bf": "0"})
    with av.open(str(tmp_path / "a.mp4")) as whole, av.open(str(tmp_path / "b.mp4"), "w") as out:
        stream = out.add_stream_from_template(whole.streams.video[0])
        for packet in whole.demux(video=0):
            if packet.dts is not None:
                shift = round(12 / 25 / packet.time_base)
                packet.pts, packet.dts = packet.pts - shift, packet.dts - shift
                packet.stream = stream
                out.mux(packet)
    clip = read_clip(tmp_path / "b.mp4")
    assert shows(clip.frames, reach(30)[12:]) < 8 and clip.times[0] == 0


def interlaced(path, codec, options):
    """Fields that are half a frame apart: a bright bar moves by 8 pixels between them."""
    fields = np.repeat(room()[None], 40, axis=0)
    for t, field in enumerate(fields):
        field[:, 8 + 3 * t : 20 + 3 * t] = 230
    frames = fields[::2].copy()
    frames[:, 1::2] = fields[1::2, 1::2]
    encode(path, frames, codec, options=options)
    return fields[::2]


@pytest.mark.parametrize(
    "name, codec, options",
    [
        ("dvd.mpg", "mpeg2video", {"flags": "+ildct+ilme", "b": "4M"}),
        ("avchd.mts", "libx264", {"flags": "+ildct+ilme", "x264-params": "tff=1"}),
    ],
)
def test_interlaced_frames_show_one_moment(tmp_path, name, codec, options):
    fields = interlaced(tmp_path / name, codec, options)
    clip = read_clip(tmp_path / name)
    assert "Interlaced frames were made whole." in clip.notes
    # A comb would alternate from row to row.
    grey = clip.frames[5:15].mean(axis=3)
    comb = np.abs(grey[:, 1:-1] - (grey[:, 2:] + grey[:, :-2]) / 2)
    flat = np.abs((f := fields[5:15].mean(axis=3))[:, 1:-1] - (f[:, 2:] + f[:, :-2]) / 2)
    assert comb.mean() < flat.mean() + 1


def test_pixels_that_are_not_square_are_squared(tmp_path):
    def wide(stream):
        stream.codec_context.sample_aspect_ratio = 2

    squeezed = np.stack([cv2.resize(f, (W // 2, H)) for f in reach()])
    clip = read_clip(encode(tmp_path / "a.mp4", squeezed, prepare=wide))
    assert clip.frames.shape[1:3] == (H, W) and shows(clip.frames, reach()) < 9
    assert clip.notes == ["Its pixels, 2 times as wide as high, were squared."]


TURNS = {  # the file's matrix, and what is done to the stored picture
    "90": ((0, 1, -1, 0), lambda f: np.rot90(f, -1, (1, 2))),
    "180": ((-1, 0, 0, -1), lambda f: f[:, ::-1, ::-1]),
    "270": ((0, -1, 1, 0), lambda f: np.rot90(f, 1, (1, 2))),
    "mirrored": ((-1, 0, 0, 1), lambda f: f[:, :, ::-1]),
    "mirrored, 90": ((0, -1, -1, 0), lambda f: np.rot90(f[:, :, ::-1], -1, (1, 2))),
}


@pytest.mark.parametrize("name", TURNS)
def test_pictures_stand_upright(tmp_path, name):
    (a, b, c, d), turned = TURNS[name]

    def turn(stream):
        one = 1 << 16
        stream.set_display_matrix([a * one, b * one, 0, c * one, d * one, 0, 0, 0, 1 << 30])

    clip = read_clip(encode(tmp_path / "a.mp4", reach(), prepare=turn))
    assert shows(clip.frames, turned(reach())) < 8
    assert any("as the file asks" in note for note in clip.notes)


def test_a_turn_can_be_asked_for(tmp_path):
    clip = read_clip(encode(tmp_path / "a.mp4", reach()), turn=90)
    assert shows(clip.frames, np.rot90(reach(), -1, (1, 2))) < 8


@pytest.mark.parametrize("top, left", [(40, 0), (0, 60)], ids=["letterbox", "pillarbox"])
def test_black_borders_are_cut_off(tmp_path, top, left):
    boxed = np.zeros((30, H + 2 * top, W + 2 * left, 3), np.uint8)
    boxed[:, top : top + H, left : left + W] = reach()
    clip = read_clip(encode(tmp_path / "a.mp4", boxed))
    h, w = clip.frames.shape[1:3]
    assert H - 6 <= h <= H and W - 6 <= w <= W and clip.notes == ["Black borders were cut off."]
    assert len(read_clip(tmp_path / "a.mp4", crop=False).frames[0]) == H + 2 * top


def test_a_boxed_picture_keeps_its_pixels(tmp_path):
    """An upright clip in a wide film: shrunk as a whole, it would be 101 pixels wide."""
    upright = arm(np.linspace(0.1, 0.6, 8), room(360, 200))
    boxed = np.zeros((8, 360, 640, 3), np.uint8)
    boxed[:, :, 220:420] = upright
    clip = read_clip(encode(tmp_path / "a.mp4", boxed))
    assert 310 <= clip.frames.shape[1] <= 320 and 170 <= clip.frames.shape[2] <= 180


def test_a_dark_room_is_no_border(tmp_path):
    dark = np.zeros((20, H, W, 3), np.uint8)
    for t, frame in enumerate(dark):  # a lit hand before black
        cv2.circle(frame, (30 + 4 * t, 48), 20, (220, 180, 150), -1)
    assert read_clip(encode(tmp_path / "a.mp4", dark)).frames.shape[1:3] == (H, W)


@pytest.mark.parametrize("still_first", [True, False])
def test_the_stream_that_moves_is_taken(tmp_path, still_first):
    still = np.repeat(room(2 * H, 2 * W, seed=1)[None], 30, axis=0)  # larger, and still
    films = [still, reach()] if still_first else [reach(), still]
    with av.open(str(tmp_path / "a.mp4"), "w") as out:
        out.mux([packet for film in films for packet in add(out, film, "libx264")])
    clip = read_clip(tmp_path / "a.mp4")
    assert shows(clip.frames, reach()) < 8
    number = 2 if still_first else 1
    assert clip.notes == [f"Of the file's 2 streams of pictures, number {number} was taken."]
    other = read_clip(tmp_path / "a.mp4", stream=3 - number)
    assert other.frames.shape[1] == 2 * H
    with pytest.raises(InputError, match="stream 3 is not among its 2 of pictures"):
        read_clip(tmp_path / "a.mp4", stream=3)


def loop(n=40, start=15):
    """A loop that starts in the middle: the arm reaches its end, is back, and goes on."""
    frames = reach(n)
    return np.concatenate([frames[start:], frames[:start]]), n - start


@pytest.mark.parametrize("rate", [10, 25, 60])
def test_a_jump_cut_is_found_and_the_longest_piece_kept(tmp_path, rate):
    frames, cut = loop()
    clip = read_clip(encode(tmp_path / "a.mp4", frames, rate=rate))
    assert clip.cuts == [cut]
    piece = steady(clip)
    assert len(piece.frames) == cut and piece.cuts == [] and piece.times[0] == 0
    assert np.array_equal(piece.frames, clip.frames[:cut])


def test_noise_and_a_start_from_rest_are_no_cuts(tmp_path):
    frames = arm(np.r_[np.full(15, 0.1), 0.1 + 0.5 * np.sin(np.linspace(0, np.pi / 2, 12)) ** 2])
    noisy = frames + np.random.default_rng(0).normal(0, 8, frames.shape)
    path = encode(tmp_path / "a.mp4", np.clip(noisy, 0, 255).astype(np.uint8))
    assert read_clip(path).cuts == []


def test_a_motion_that_nobody_filmed_is_a_cut_and_a_pause_is_none(tmp_path):
    times = np.r_[0:15, 40:55] / 25  # a second is missing
    path = encode(tmp_path / "a.mp4", arm(0.1 + 0.2 * times), times=times)
    assert read_clip(path).cuts == [15]
    path = encode(tmp_path / "b.mp4", arm(0.1 + 0.2 * np.r_[0:15, 15:30] / 25), times=times)
    assert read_clip(path).cuts == []


def test_a_long_film_is_read_where_it_moves(tmp_path, monkeypatch):
    """Six seconds into twenty the arm comes. Memory for a fifth of it is enough."""
    monkeypatch.setattr(clips, "MOST", 5 * 25 * H * W * 3)
    shares = np.r_[np.full(150, 0.1), np.linspace(0.1, 0.6, 50), np.full(300, 0.6)]
    for options in ({"g": "25"}, {"g": "500"}):  # key frames that show it, and one only
        clip = read_clip(encode(tmp_path / "a.mp4", arm(shares), options=options))
        assert clip.times[-1] < 5.1 and np.diff(clip.times).max() < 0.05
        assert shows(clip.frames[:15], arm(np.full(15, 0.1))) < 8
        assert shows(clip.frames[-15:], arm(np.full(15, 0.6))) < 8
        assert "the longest stretch in which something moves" in clip.losses[-1]
        # by the seconds at which it begins and ends it can be asked for, as by clicks
        end = clip.start + clip.times[-1]
        again = read_clip(tmp_path / "a.mp4", start=clip.start, end=end + 1e-3, cuts=False)
        assert clip.start > 4 and again.start == clip.start
        np.testing.assert_array_equal(again.frames, clip.frames)


def test_memory_does_not_grow_with_the_length(tmp_path, monkeypatch):
    monkeypatch.setattr(clips, "MOST", 20 * H * W * 3)
    clip = read_clip(encode(tmp_path / "a.mp4", reach(100)), start=0, end=10)
    assert len(clip.frames) <= 20 and "100 frames are many; one in 8 is used" in clip.losses[0]
    assert shows(clip.frames, reach(100)[::8]) < 8 and clip.cuts == []


def test_a_piece_can_be_asked_for(tmp_path):
    clip = read_clip(encode(tmp_path / "a.mp4", reach(100)), start=1.0, end=2.0)
    assert len(clip.frames) == 26 and shows(clip.frames, reach(100)[25:51]) < 8


def test_what_comes_after_a_piece_is_not_read(tmp_path, monkeypatch):
    decoded = []

    class Counted(clips.Decoder):
        def __iter__(self):
            for frame in super().__iter__():
                decoded.append(frame)
                yield frame

    monkeypatch.setattr(clips, "Decoder", Counted)
    read_clip(encode(tmp_path / "a.mp4", reach(100)), start=0, end=1.0)
    assert len(decoded) == 27  # one that is beyond the end tells that it is


@pytest.mark.skipif(sys.platform != "linux", reason="needs Linux, whose /proc tells the peak")
def test_4k_needs_little_memory(tmp_path):
    """30 frames are 375 MB, if what was decoded is kept."""
    large = (cv2.resize(f, (3840, 2160), interpolation=cv2.INTER_NEAREST) for f in [reach(1)[0]])
    path = encode(tmp_path / "a.mp4", [*large] * 30, options={"preset": "ultrafast"})
    code = (
        "import sys; from lbw_minimal.clips.reader import read_clip\n"
        # not getrusage's, in which the process that started this one counts, too
        "peak = lambda: int(open('/proc/self/status').read().split('VmHWM:')[1].split()[0])\n"
        "before = peak(); read_clip(sys.argv[1]); print(peak() - before)"
    )
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, check=True)
    assert int(done.stdout) < 250_000  # kB; measured 105,000


def test_4k_is_shrunk_to_what_it_shows(tmp_path):
    large = [cv2.resize(f, (3840, 2160), interpolation=cv2.INTER_NEAREST) for f in reach(4)]
    path = encode(tmp_path / "a.mp4", large, options={"preset": "ultrafast"})
    clip = read_clip(path)
    assert clip.frames.shape == (4, 180, 320, 3)
    small = [cv2.resize(f, (320, 180), interpolation=cv2.INTER_AREA) for f in large]
    assert shows(clip.frames, small) < 8


def film_of(stamps, rate=25.0, every=1):
    return SimpleNamespace(
        stamps=list(stamps), frames=np.zeros(len(stamps)), every=every, losses=[],
        stream=SimpleNamespace(rate=rate),
    )  # fmt: skip


def test_times_that_fall_back_are_put_behind_one_another():
    """Two recordings in one file; frames that come a little out of order are sorted."""
    film = film_of([0, 0.04, 0.08, 5.0, 0.0, 0.04, 0.08])
    times = clips._rising(film)
    assert times == pytest.approx([0, 0.04, 0.08, 5.0, 5.04, 5.08, 5.12]) and not film.losses
    assert clips._rising(film_of([0, 0.08, 0.04, 0.12])) == pytest.approx([0, 0.04, 0.08, 0.12])


def test_where_times_are_missing_or_stand_still_the_rate_is_believed():
    """Every third frame of 30 a second is kept."""
    for stamps in ([0, None, 0.2, 0.3], [0.0, 0, 0, 0]):
        film = film_of(stamps, rate=30.0, every=3)
        assert clips._rising(film) == pytest.approx([0, 0.1, 0.2, 0.3])
        assert film.losses == ["Its frames have no time stamps; 30 a second were assumed."]


@pytest.mark.parametrize(("back", "second"), [(2.9, False), (3.1, True)])
def test_times_that_fall_back_by_three_seconds_are_of_another_recording(back, second):
    """By less they are of frames out of order."""
    stamps = [0, 1, 2, 3, 4, 4 - back, 5 - back]
    times = clips._rising(film_of(stamps))
    if second:
        assert times == pytest.approx([0, 1, 2, 3, 4, 4.04, 5.04])
    else:
        assert times == pytest.approx(sorted(stamps))


class Film:
    """A film of three frames that are as bright as their stream is wide."""

    every, stamps, start = 1, (0.0, 0.1, 0.2), 0.0

    def __init__(self, path, stream, *options):
        self.stream, self.notes, self.losses = stream, [], []
        self.frames = np.full((3, 1, 1, 1), stream.width)

    def read(self):
        pass


def tell(monkeypatch, said, *shown):
    """A file says `said` of itself and has streams: each one's rate, width, whether it moves."""
    streams = [SimpleNamespace(rate=rate, width=width) for rate, width, _ in shown]
    moves = {width: moves for _, width, moves in shown}
    monkeypatch.setattr(clips, "_Film", Film)
    monkeypatch.setattr(clips, "look", lambda path: (streams, said))
    monkeypatch.setattr(clips.motion, "moves", lambda frames: moves[frames[0, 0, 0, 0]])


@pytest.mark.parametrize(
    ("captured", "rate", "slow"),
    [("240", 30, 8), ("120", 30, 4), ("100", 25, 4), ("99", 25, 1), ("60", 25, 1), ("120", 60, 1),
     ("121", 60, 121 / 60)],
)  # fmt: skip
def test_slow_motion_is_a_hundred_frames_a_second_and_twice_the_films_own(
    captured, rate, slow, monkeypatch
):
    """A phone's 60 frames a second, shown as they were taken, are no slow motion."""
    tell(monkeypatch, {clips.CAPTURED: captured}, (rate, 320, True))
    clip = read_clip("film.mp4", cuts=False)
    assert clip.times[-1] == pytest.approx(0.2 / slow) and bool(clip.notes) == (slow != 1)


@pytest.mark.parametrize(("said", "first", "last"), [({clips.CAPTURED: "200"}, 50, 75), ({}, 7, 9)])
def test_a_piece_of_slow_motion_is_asked_for_by_the_seconds_that_it_comes_with(
    said, first, last, tmp_path, monkeypatch
):
    """At 25 of 200 frames a second it is read as half a second, of which the third quarter is asked
    for; the film itself takes four. A click into `prepare`'s page writes seconds so."""
    path = encode(tmp_path / "a.mp4", reach(100))
    look = clips.look
    monkeypatch.setattr(clips, "look", lambda path: (look(path)[0], look(path)[1] | said))
    whole = read_clip(path, cuts=False)
    piece = read_clip(path, start=0.25, end=0.375, cuts=False)
    inside = np.flatnonzero((whole.times >= 0.25) & (whole.times <= 0.375))
    assert [*inside[[0, -1]]] == [first, last]
    np.testing.assert_array_equal(piece.frames, whole.frames[inside])
    np.testing.assert_allclose(piece.times, whole.times[inside] - whole.times[inside[0]], atol=1e-9)
    assert whole.start == 0 and piece.start == pytest.approx(whole.times[first])


@pytest.mark.parametrize(
    ("shown", "taken"),
    [
        ([(640, False), (320, True)], 2),  # a still title
        ([(320, True), (640, True)], 2),  # a preview
        ([(640, True), (320, True)], 1),
        ([(320, False), (640, False)], 2),
        ([(64, True), (640, False), (320, True)], 3),
    ],
)
def test_of_several_streams_the_widest_of_those_that_move_is_taken(shown, taken, monkeypatch):
    tell(monkeypatch, {}, *((25, width, moves) for width, moves in shown))
    clip = read_clip("film.mp4", cuts=False)
    assert clip.frames[0, 0, 0, 0] == shown[taken - 1][0]
    assert clip.notes == [
        f"Of the file's {len(shown)} streams of pictures, number {taken} was taken."
    ]


@pytest.mark.parametrize(("pause", "end"), [(3, 24), (4, 16)])
def test_a_pause_of_three_seconds_belongs_to_a_motion_and_a_longer_one_ends_it(pause, end):
    """A square moves from 10 to 15 s, and after the pause for four seconds more. Key frames come
    every second."""
    at = np.cumsum([1 if 10 <= t < 15 or 15 + pause <= t < 19 + pause else 0 for t in range(60)])
    frames = np.full((60, 84, 84, 3), 100, np.uint8)
    for frame, x in zip(frames, at, strict=True):
        frame[30:50, 4 * x : 4 * x + 20] = 220
    film = clips._Film("film", clips.Stream(0, 640, 480, 1.0, 25.0, 60.0), None, None, None, True)
    assert film._choose(list(np.arange(60.0)), frames)
    assert film.start == 8 and film.end == pytest.approx(end, abs=2)
    assert (film.end > 20) == (pause == 3)


def test_of_frames_at_one_moment_the_first_is_kept(monkeypatch):
    class Film:
        every, start, notes, losses = 1, 0.0, [], []
        stamps = [0.5, 0.54, 0.54, 0.58, 0.62]
        frames = np.arange(5, dtype=np.uint8).reshape(5, 1, 1, 1)

        def __init__(self, path, stream, *options):
            self.stream = stream

        def read(self):
            pass

    stream = SimpleNamespace(width=1, rate=25.0)
    monkeypatch.setattr(clips, "_Film", Film)
    monkeypatch.setattr(clips, "look", lambda path: ([stream], {}))
    clip = read_clip("film.mp4", cuts=False)
    assert clip.frames.ravel().tolist() == [0, 1, 3, 4]
    assert clip.times == pytest.approx([0, 0.04, 0.08, 0.12])


def test_the_longest_piece_is_that_of_most_seconds_and_begins_at_0():
    """Two frames in 2 s outlast five in 0.4."""
    frames = np.arange(10, dtype=np.uint8)
    times = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 5.0, 7.0, 8.0, 8.1, 8.2])
    piece = steady(clips.Clip(frames, times, [5, 7], ["a note"], ["a loss"]))
    assert piece.frames.tolist() == [5, 6] and piece.times.tolist() == [0, 2]
    assert (piece.cuts, piece.notes, piece.losses) == ([], ["a note"], ["a loss"])


def test_of_a_long_film_the_longest_stretch_is_chosen_with_a_second_around_it():
    """A small square moves from 10 to 14 s, and from 40 to 60 s; key frames are a second apart."""
    at = np.zeros(100, int)
    at[10:14], at[14:40], at[40:60], at[60:] = np.arange(4), 4, 4 + np.arange(20), 24
    frames = np.full((100, 84, 84, 3), 100, np.uint8)
    for frame, x in zip(frames, at, strict=True):
        frame[30:50, 2 * x : 2 * x + 20] = 220
    film = clips._Film("film", clips.Stream(0, 640, 480, 1.0, 25.0, 100.0), None, None, None, True)
    said = film._choose(list(np.arange(100.0)), frames)
    assert (film.start, film.end) == (39, 61) or (film.start, film.end) == (38, 61)
    assert said.startswith(f"Of 99 seconds, {film.start:.1f} to 61.0 were taken")
    assert film._choose(list(np.arange(100.0)), frames[:1].repeat(100, 0)) == ""


@pytest.mark.parametrize(("covered", "whole", "refused"), [(9.6, 1, 0), (9.4, 1, 1), (5, 0, 0)])
def test_a_film_is_cut_short_if_a_twentieth_of_what_its_header_promises_is_missing(
    covered, whole, refused
):
    film = clips._Film("film", clips.Stream(0, 640, 480, 1.0, 25.0, 10.0), None, None, None, True)
    decoder = SimpleNamespace(promised=10.0, covered=covered, packets=9)
    if refused:
        with pytest.raises(InputError, match=r"promises 10\.0 s and 9\.4 s can be read"):
            film._check(decoder, 9, bool(whole))
    else:
        film._check(decoder, 9, bool(whole))
    with pytest.raises(InputError, match="none of its pictures can be decoded"):
        film._check(SimpleNamespace(promised=0, covered=0, packets=3), 0, True)
    with pytest.raises(InputError, match="the video has no frames"):
        film._check(SimpleNamespace(promised=0, covered=0, packets=0), 0, True)


def test_a_film_is_thinned_by_halves_until_it_fits(tmp_path, monkeypatch):
    """Room for 20 of 50 frames: every fourth is kept, with its own time."""
    path = encode(tmp_path / "a.mp4", reach(50))
    monkeypatch.setattr(clips, "MOST", 20 * H * W * 3)
    monkeypatch.setattr(clips._Film, "_by_key_frames", lambda film: "")
    monkeypatch.setattr(clips._Film, "_choose", lambda *_: "")
    clip = read_clip(path)
    assert clip.times == pytest.approx(np.arange(0, 50, 4) / 25, abs=1e-3)
    assert shows(clip.frames, reach(50)[::4]) < 8
    assert clip.losses == ["50 frames are many; one in 4 is used, 13 in all."]
