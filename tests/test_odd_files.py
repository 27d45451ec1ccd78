"""Files, names and options as a hostile tester gave them: each gets a true sentence and no more."""

import io
import os
import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from types import SimpleNamespace

import av
import numpy as np
import pytest

import tasks
from lbw_minimal.clips import motion, reader, screen
from lbw_minimal.clips.decoding import Decoder, check_file, look
from lbw_minimal.clips.reader import read_clip
from lbw_minimal.clips.upright import Upright
from lbw_minimal.training import InputError, write_atomic
from tasks.__main__ import PIPE_CLOSED, main
from tasks.commands import choices, links, make_folder
from tests.toy_clips import encode, reach


@pytest.fixture
def server():
    """A web server on this machine; its `asked` lists what was asked for."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            self.server.asked.append(self.path)
            self.send_error(404)

        def log_message(self, *_):
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    server.asked = []
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


def test_a_playlist_makes_nothing_else_be_opened(tmp_path, server):
    """Nothing leaves the machine, and no other file comes in. Two odd bytes: it is no text."""
    film = encode(tmp_path / "film.ts", reach(), "mpeg2video")
    for target in (f"http://127.0.0.1:{server.server_port}/a.ts", film.as_uri(), str(film)):
        path = tmp_path / "list.m3u8"
        path.write_bytes(
            b"#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\xff\xfe\n" + target.encode()
            + b"\n#EXT-X-ENDLIST\n"
        )  # fmt: skip
        with pytest.raises(InputError, match="no video that FFmpeg can read"):
            read_clip(path)
    assert server.asked == []


def test_side_data_without_a_name_turns_nothing():
    """A camera's Exif, in frames of MJPEG: PyAV asks for a name for each of a frame's."""

    class Nameless:
        def get(self, _):
            raise ValueError("31 is not a valid Type")

    stream = SimpleNamespace(width=96, height=64, pixel=1.0)
    frame = av.VideoFrame.from_ndarray(np.full((64, 96, 3), 90, np.uint8))
    assert Upright(stream)(frame).shape == (64, 96, 3)
    assert Upright(stream)._turning(SimpleNamespace(side_data=Nameless())) == (1, 0, 0, 1)


def test_a_stream_without_times_cannot_be_entered_and_is_counted(tmp_path):
    path = encode(tmp_path / "a.h264", reach())
    whole, piece = read_clip(path, cuts=False), read_clip(path, start=0.4, end=0.8, cuts=False)
    np.testing.assert_array_equal(piece.frames, whole.frames[10:21])
    assert piece.start == pytest.approx(0.4) and "no time stamps" in piece.losses[0]


@pytest.mark.parametrize("keys", ["12", "1000"])
@pytest.mark.parametrize("name", ["a.ts", "a.mpg", "a.mkv"])
def test_a_piece_begins_where_it_was_asked_to(name, keys, tmp_path):
    """A transport stream is entered behind the place; with one key frame, behind all of it. In a
    program stream times are half a frame off where it is entered: few of its packets state one."""
    path = encode(tmp_path / name, reach(50), "mpeg2video", options={"g": keys, "qscale": "2"})
    whole = read_clip(path, cuts=False)
    piece = read_clip(path, start=1.0, end=1.6, cuts=False)
    inside = np.flatnonzero((whole.times > 0.99) & (whole.times < 1.61))
    np.testing.assert_array_equal(piece.frames, whole.frames[inside])
    assert piece.start == pytest.approx(whole.times[inside[0]], abs=0.021)


def test_a_long_film_is_entered_and_not_read_from_its_start(tmp_path):
    path = encode(tmp_path / "a.mp4", reach(50), options={"g": "10"})
    (stream,), _ = look(path)
    assert 1.0 <= next(iter(Decoder(path, stream, start=1.5)))[0] <= 1.5


def test_the_page_rounds_the_time_of_a_picture_that_may_be_the_first(tmp_path):
    """0.0667 s is 0.067 s there."""
    path = encode(tmp_path / "a.mp4", reach(12), rate=30)
    whole = read_clip(path, cuts=False)
    for k in range(9):
        piece = read_clip(path, start=round(whole.times[k], 3) or None, cuts=False)
        assert len(piece.frames) == 12 - k


def test_a_piece_that_begins_in_a_gap_is_timed_from_its_first_frame(tmp_path):
    times = np.r_[np.arange(20), np.arange(50, 70)] / 25
    path = encode(tmp_path / "a.mkv", reach(40), times=times)
    piece = read_clip(path, start=1.2, cuts=False)
    assert len(piece.frames) == 20 and piece.start == pytest.approx(2.0, abs=2e-3)
    again = read_clip(path, start=round(piece.start, 3), end=2.76, cuts=False)
    np.testing.assert_array_equal(again.frames, piece.frames)


@pytest.mark.parametrize(
    ("piece", "said"),
    [
        (dict(end=0.01), "this piece of it has a single frame; give a longer one"),
        (dict(start=50), r"no frames in this piece; it is 1\.2 s long\."),
    ],
)
@pytest.mark.parametrize("name", ["a.mp4", "a.flv"])
def test_what_is_wrong_with_a_piece_is_not_said_of_the_film(name, piece, said, tmp_path):
    path = encode(tmp_path / name, reach(), "flv1" if name == "a.flv" else "libx264")
    with pytest.raises(InputError, match=said):
        read_clip(path, **piece)


def test_a_film_whose_size_never_came_is_cut_short(tmp_path):
    path = encode(tmp_path / "a.flv", reach(), "flv1")
    path.write_bytes(path.read_bytes()[:400])
    with pytest.raises(InputError, match="cut short"):
        read_clip(path)


@pytest.mark.parametrize("captured", ["abc", "inf", "nan", "-240", "1e9"])
def test_a_number_of_frames_that_no_camera_takes_is_no_slow_motion(captured):
    assert reader._slow(SimpleNamespace(rate=30.0), {reader.CAPTURED: captured}) == 1


@pytest.mark.parametrize(
    ("stamps", "kept"),
    [(np.repeat(np.arange(6), 2) / 10, True), (np.r_[np.arange(6), np.arange(6)] / 10, False)],
)
def test_times_that_are_each_stated_twice_are_times(stamps, kept):
    """And not those of a second recording, which begin anew."""
    film = SimpleNamespace(
        stamps=[*stamps], stream=SimpleNamespace(rate=25.0), every=1, frames=stamps, losses=[]
    )
    assert np.array_equal(reader._rising(film), stamps) == kept == (not film.losses)


def test_a_strip_is_looked_at_for_jumps_and_told_by_its_shape_alone():
    """Two pixels wide: as wide as others are made it would be 17,920 high."""
    rng = np.random.default_rng(0)
    strip = rng.integers(0, 255, (6, 320, 2, 3), np.uint8)
    assert isinstance(motion.jumps(strip, np.arange(6) / 25), list)
    one = np.full((9, 1, 1, 3), 200, np.uint8)
    assert screen.recorded(one) is None and screen.recorded(one.repeat(84, 1).repeat(84, 2))


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("/", "a folder"), (os.devnull, "a device"), ("none.mp4", "no such file"),
        (300 * "a" + ".mp4", "no such file"), ("a\0.mp4", "no such file"),
    ],
)  # fmt: skip
def test_what_is_no_file_is_called_what_it_is(path, said):
    with pytest.raises(InputError, match=said):
        check_file(Path(path))


@pytest.mark.parametrize("text", ["1e13", "1e308", "inf", "nan", "-1"])
def test_seconds_are_those_of_a_clip(text):
    with pytest.raises(InputError, match="is no time in seconds from 0 on"):
        choices.parser().read(["push", "a.mp4", "--from", text])


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (["push", "--", "-a.mp4"], ["push", "./-a.mp4"]),
        (["push", "--mirror", "--", "a.mp4"], ["push", "--mirror", "a.mp4"]),
        (["push", "a.mp4", "--from", "2"], ["push", "a.mp4", "--from", "2"]),
    ],
)
def test_a_click_can_add_an_option_to_the_command(argv, said):
    args = choices.parser().read(argv)
    assert choices.open_ended(argv, args.file) == said
    assert choices.parser().read([*said, "--to", "3"]).last == 3


def test_a_link_leads_to_a_folder_of_any_name(tmp_path):
    for name in ("reach-a#1", 'push-50% "?'):
        (tmp_path / name).mkdir()
        (tmp_path / name / "prepare.html").touch()
        (tmp_path / name / "report.html").touch()
    (tmp_path / "gallery").mkdir()
    text = links.links(tmp_path / "gallery" / "index.html", tmp_path)
    assert '"../reach-a%231/report.html"' in text
    assert '"../push-50%25%20%22%3F/report.html"' in text


def test_a_folder_that_cannot_be_written_to_is_told_before_anything_is(tmp_path, monkeypatch):
    def shut(dir):
        raise PermissionError(13, "Permission denied")

    make_folder(tmp_path / "a")
    assert not [*(tmp_path / "a").iterdir()]
    monkeypatch.setattr(tasks.commands.tempfile, "TemporaryFile", shut)
    with pytest.raises(InputError, match="cannot write there"):
        make_folder(tmp_path / "a")


def test_a_name_that_is_no_text_can_be_written_into_one(tmp_path):
    write_atomic(tmp_path / "a.html", os.fsdecode(b"\xff.mp4"))
    assert (tmp_path / "a.html").read_text() == r"\udcff.mp4"


def test_a_letter_that_the_terminal_does_not_know_ends_nothing(monkeypatch):
    out = io.TextIOWrapper(io.BytesIO(), "ascii", write_through=True)
    monkeypatch.setattr(sys, "stdout", out)
    assert main(["--help"]) == 0
    print("\N{WAVING HAND SIGN}.mp4")
    assert out.buffer.getvalue().endswith(b"\\U0001f44b.mp4" + os.linesep.encode())


@pytest.mark.skipif(os.name == "nt", reason="needs a pipe that tells who reads it has gone")
def test_who_has_read_enough_is_told_nothing_more():
    line = [sys.executable, "-m", "tasks", "--help"]
    asked = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tasks.ROOT)
    asked.stdout.close()
    assert asked.stderr.read() == b"" and asked.wait() == PIPE_CLOSED
    asked.stderr.close()
