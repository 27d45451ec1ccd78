"""What cannot be read gets one sentence with the file's name, the true reason and what helps."""

import os
import time
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import av
import numpy as np
import pytest
from PIL import Image
from toy_clips import H, W, add, add_sound, encode, reach, room

from lbw_minimal.clips import decoding
from lbw_minimal.clips.decoding import Decoder, look
from lbw_minimal.clips.reader import read_clip
from lbw_minimal.training import InputError


def noise(n):
    """n bytes, the same each time: by chance some others begin as a film of some kind does."""
    return np.random.default_rng(0).bytes(n)


def write(path, data):
    path.write_bytes(data)


def film(folder, name="good.mp4", codec="libx264", n=30, **how):
    whole = encode(folder / f"_{name}", reach(n), codec, **how)
    data = whole.read_bytes()
    whole.unlink()
    return data


def half(path):
    data = film(path.parent)
    write(path, data[: len(data) // 2])


def half_with_its_index_first(path):
    data = film(path.parent, options={"g": "5", "crf": "5"}, container={"movflags": "faststart"})
    write(path, data[: len(data) // 2])


def half_an_avi(path):
    data = film(path.parent, "a.avi", "mjpeg", fmt="yuvj420p")
    write(path, data[: len(data) // 2])


def half_an_mkv(path):
    data = film(path.parent, "a.mkv", "ffv1")
    write(path, data[: len(data) // 2])


def damaged_from_the_start(path):
    write(path, noise(3000) + film(path.parent)[3000:])


def damaged_pictures(path):
    data = bytearray(film(path.parent))
    start, end = data.index(b"mdat") + 4, data.index(b"moov") - 4
    data[start:end] = b"\xa5" * (end - start)
    write(path, data)


def no_decoder(path):
    write(path, film(path.parent).replace(b"avc1", b"zzzz").replace(b"avcC", b"zzzC"))


def sound(path):
    with av.open(str(path), "w") as out:
        out.mux(add_sound(out))


def sound_with_a_cover(path):
    def cover(stream):
        stream.disposition = av.stream.Disposition.attached_pic

    with av.open(str(path), "w", format="mp4") as out:
        packets = add(out, room()[None], "mjpeg", 1, fmt="yuvj420p", prepare=cover)
        out.mux(packets + add_sound(out))


def picture(kind):
    return lambda path: Image.fromarray(room()).save(path, kind)


def sparse(path):
    path.touch()
    os.truncate(path, 2 << 30)


def web_page(path):
    path.write_text("<!DOCTYPE html><html><title>Sign in – ünïcode</title></html>\n" * 50)


def archive(path):
    write(path, b"PK\x03\x04" + noise(5000))


COPY = "copy or export it again"
BAD = {
    "missing": (lambda path: None, "there is no such file; check the path"),
    "folder": (os.mkdir, "this is a folder; give the video file itself"),
    "nothing inside": (lambda path: path.touch(), f"the file is empty; {COPY}"),
    "zeros, 2 GB": (sparse, f"begins with nothing but zeros, .*; {COPY}"),
    "text": (lambda path: path.write_text("no film\n"), "this is text, not a video; give an mp4"),
    "web page": (web_page, "this is text, not a video; give an mp4"),
    "archive": (archive, "this is a zip archive; unpack it"),
    "noise": (
        lambda path: write(path, noise(9000)),
        "no video that FFmpeg can read, or it is",
    ),
    "half": (half, f"cut short, its index is missing; {COPY}"),
    "half, index first": (half_with_its_index_first, "promises 1.2 s and 0.[3-9] s can be read"),
    "half an avi": (half_an_avi, "promises 1.2 s and 0.[3-9] s can be read"),
    "half an mkv": (half_an_mkv, "promises 1.2 s and 0.[3-9] s can be read"),
    "damaged start": (damaged_from_the_start, f"damaged from the start; .*{COPY}"),
    "damaged pictures": (damaged_pictures, "none of its pictures can be decoded, it is damaged"),
    "no decoder": (no_decoder, r"cannot be decoded here; export it as H.264 \(mp4\)"),
    "sound": (sound, "has sound but no picture; give a video, recorded with the camera on"),
    "sound with a cover": (sound_with_a_cover, "sound with a cover picture, not a video"),
    "one frame": (
        lambda path: encode(path, reach(1)),
        "single frame, a still picture; give one in which the arm",
    ),
    **{
        kind: (
            picture(kind),
            "a still picture; give (a video in|one in) which the arm does the task",
        )
        for kind in ("JPEG", "PNG", "GIF", "WEBP", "BMP", "TIFF")
    },
}


@pytest.mark.parametrize("make, sentence", BAD.values(), ids=BAD.keys())
def test_what_is_no_film_gets_one_sentence_and_a_remedy_at_once(tmp_path, capfd, make, sentence):
    path = tmp_path / "mine.mp4"
    make(path)
    capfd.readouterr()
    start = time.process_time()
    with pytest.raises(InputError, match=rf"^{path}: [^\n]*{sentence}[^\n]*\.$"):
        read_clip(path)
    assert time.process_time() - start < 2
    assert capfd.readouterr() == ("", "")


def test_text_is_no_film_of_a_terminal(tmp_path):
    (tmp_path / "notes.txt").write_text("this is no film\n" * 100)
    with pytest.raises(InputError, match="this is text"):
        read_clip(tmp_path / "notes.txt")


@pytest.mark.skipif(
    os.name == "nt" or os.geteuid() == 0, reason="needs a user who may not read every file"
)
def test_a_file_that_may_not_be_read_says_so(tmp_path):
    encode(tmp_path / "mine.mp4", reach()).chmod(0)
    with pytest.raises(InputError, match="Permission denied"):
        read_clip(tmp_path / "mine.mp4")


def test_a_title_may_be_no_utf8(tmp_path):
    path = encode(tmp_path / "a.mp4", reach(), metadata={"title": "Mxxller"})
    assert path.read_bytes().count(b"Mxxller") == 1
    path.write_bytes(path.read_bytes().replace(b"Mxxller", b"M\xfc\xe9ller"))
    assert look(path)[1]["title"] == "M\udcfc\udce9ller"


def test_zeros_behind_a_film_do_no_harm(tmp_path):
    write(tmp_path / "a.mp4", film(tmp_path))
    os.truncate(tmp_path / "a.mp4", 2 << 30)
    assert len(read_clip(tmp_path / "a.mp4").frames) == 30


def test_a_damaged_middle_is_left_out_and_said(tmp_path):
    data = bytearray(film(tmp_path, n=60, options={"g": "10", "bf": "0"}))
    middle = data.index(b"mdat") + (data.index(b"moov") - data.index(b"mdat")) // 2
    data[middle : middle + 3000] = b"\xff" * 3000
    write(tmp_path / "a.mp4", data)
    clip = read_clip(tmp_path / "a.mp4")
    assert 20 < len(clip.frames) <= 60 and "Damaged places were left out." in clip.losses


def test_a_browsers_recording_that_was_broken_off_is_read_as_far_as_it_goes(tmp_path):
    """Nothing in it says how long it was to be."""
    data = film(tmp_path, "a.webm", "libvpx", options={"deadline": "realtime"},
                container={"live": "1"})  # fmt: skip
    write(tmp_path / "a.webm", data[: len(data) * 2 // 3])
    assert 10 < len(read_clip(tmp_path / "a.webm").frames) < 30


def test_sound_that_goes_on_does_not_make_a_film_cut_short(tmp_path):
    with av.open(str(tmp_path / "a.mkv"), "w") as out:
        packets = add(out, reach(), "libx264") + add_sound(out, seconds=4)
        out.mux(sorted(packets, key=lambda p: p.dts * p.time_base))
    assert len(read_clip(tmp_path / "a.mkv").frames) == 30


def test_recordings_put_one_after_another_go_on(tmp_path):
    """Time stamps begin anew in the second one."""
    write(tmp_path / "a.ts", 2 * film(tmp_path, "a.ts", "mpeg2video", n=60))
    clip = read_clip(tmp_path / "a.ts")
    assert len(clip.frames) >= 118 and clip.times[-1] == pytest.approx(4.8, abs=0.2)
    assert clip.cuts == [60]


def decoded(path, **options):
    """The stream of a file as its header describes it, a decoder that has read it, and times."""
    (stream, *_), _ = look(path)
    decoder = Decoder(path, stream, **options)
    return stream, decoder, [time for time, _ in decoder]


def test_the_header_is_told_in_pixels_rates_and_seconds(tmp_path):
    path = encode(tmp_path / "a.mp4", reach(45), rate=30)
    stream, decoder, times = decoded(path)
    assert (stream.width, stream.height, stream.pixel) == (W, H, 1.0)
    assert (stream.rate, stream.seconds) == (pytest.approx(30), pytest.approx(1.5))
    assert (len(times), decoder.packets, decoder.bad, decoder.interlaced) == (45, 45, 0, False)
    # The last frame lasts, too.
    assert decoder.covered == pytest.approx(1.5, abs=0.01) == decoder.promised


@pytest.mark.parametrize(
    ("stated", "taken"),
    [(2, 2.0), (4.8, 4.8), (6, 1.0), (0.1, 1.0), (0.992, 1.0), (1.008, 1.0), (0.98, 0.98)],
)
def test_a_shape_of_pixels_that_no_camera_has_is_a_mistake(stated, taken):
    """Pixels of nearly 1 are squares, whose picture's width was rounded."""
    stream = SimpleNamespace(
        sample_aspect_ratio=stated, average_rate=None, guessed_rate=None, duration=None, index=1,
        codec_context=SimpleNamespace(width=8, height=6),
    )  # fmt: skip
    told = decoding._describe(stream, 7.0)
    assert (told.pixel, told.rate, told.seconds, told.index) == (taken, 25.0, 7.0, 1)


def test_times_count_from_the_streams_own_start(tmp_path):
    """A transport stream begins at 1.4 s, a camera's after its preview."""
    _, decoder, times = decoded(encode(tmp_path / "a.ts", reach(30), "mpeg2video"))
    assert times[:3] == pytest.approx([0, 0.04, 0.08], abs=1e-3)
    assert decoder.covered == pytest.approx(1.2, abs=0.05)


@pytest.mark.parametrize(("name", "codec"), [("a.mkv", "libx264"), ("a.webm", "libvpx")])
def test_a_film_whose_clock_begins_late_is_not_cut_short(name, codec, tmp_path):
    """By half a second; such a file states when it ends, and others how long they are."""
    path = encode(tmp_path / name, reach(30), codec, times=0.5 + np.arange(30) / 25)
    _, decoder, times = decoded(path)
    assert times[-1] == pytest.approx(1.16, abs=2e-3)
    assert decoder.promised == pytest.approx(1.2, abs=0.05) == decoder.covered
    assert len(read_clip(path).frames) == 30


def test_a_glance_takes_key_frames_a_second_apart(tmp_path):
    """There is one every 0.48 s, so every third is taken."""
    path = encode(tmp_path / "a.mp4", reach(100), options={"g": "12", "sc_threshold": "0"})
    _, _, times = decoded(path, sparse=True)
    assert times == pytest.approx([0, 1.44, 2.88], abs=1e-3)


def test_a_start_is_looked_for_from_the_key_frame_before_it(tmp_path):
    path = encode(tmp_path / "a.mp4", reach(100), options={"g": "12", "sc_threshold": "0"})
    _, _, times = decoded(path, start=2.0)
    assert 1.3 < times[0] <= 2.0 and times[-1] == pytest.approx(3.96, abs=1e-3)


def test_no_frame_of_an_interlaced_film_is_lost(tmp_path):
    options = {"flags": "+ildct+ilme", "b": "4M"}
    path = encode(tmp_path / "a.mpg", reach(20), "mpeg2video", options=options)
    _, decoder, times = decoded(path)
    assert decoder.interlaced and len(times) == 20 and (np.diff(times) > 0).all()


def test_the_outermost_boxes_of_an_mp4_are_found_by_their_sizes(tmp_path):
    """A size of 1 says that it stands behind the name, in eight bytes."""
    path = tmp_path / "a.mp4"
    small, large = (16).to_bytes(4, "big") + b"ftyp" + 8 * b"x", (24).to_bytes(8, "big")
    wide = (1).to_bytes(4, "big") + b"mdat" + large + 8 * b"y"
    path.write_bytes(small + wide + small[:4] + b"moov" + 8 * b"z")
    assert decoding._boxes(path) == {b"ftyp", b"mdat", b"moov"}
    path.write_bytes(small + small[:4] + b"?" * 12)
    assert decoding._boxes(path) == {b"ftyp"}
    many = [str(1000 + i).encode() for i in range(100)]  # a film has ten: this is none
    path.write_bytes(b"".join((8).to_bytes(4, "big") + name for name in many))
    assert decoding._boxes(path) == set(many[:64])


def test_why_a_film_does_not_open_is_told_from_its_boxes(tmp_path):
    """An mp4's index is written last: without one it is cut short, with one it is damaged."""
    path = tmp_path / "a.mp4"

    def box(name):
        return (16).to_bytes(4, "big") + name + 8 * b"x"

    for boxes, why in (
        ((b"ftyp", b"mdat"), "cut short, its index is missing"),
        ((b"ftyp", b"moov"), "the video is damaged"),
        ((b"moov",), "the video is damaged"),
        ((b"mdat",), "no video that FFmpeg can read"),
    ):
        path.write_bytes(b"".join(map(box, boxes)))
        assert why in decoding._why_closed(path)


@pytest.mark.skipif(os.name == "nt", reason="needs a system that has its devices as files")
def test_a_device_is_no_file():
    with pytest.raises(InputError, match="this is a device"):
        look(Path("/dev/null"))


def test_text_in_either_alphabet_is_text_and_noise_is_none():
    words = "The arm pushes a cube along the table.\n" * 20
    assert decoding._is_text(words.encode()) and decoding._is_text(words.encode("utf-16"))
    noise = np.random.default_rng(0).integers(0, 256, 800, np.uint8).tobytes()
    assert not decoding._is_text(noise)


class Packet:
    """A packet of the film, of 0.04 s, with frames of which some are corrupt, or none at all."""

    time_base, duration, size, is_keyframe = Fraction(1, 25), 1, 10, True

    def __init__(self, pts, *corrupt, stream=0, error=False):
        self.pts, self.stream, self.error = pts, SimpleNamespace(index=stream), error
        self.frames = [SimpleNamespace(is_corrupt=bad, pts=pts) for bad in corrupt]

    def decode(self):
        if self.error:
            raise av.FFmpegError(1, "damaged")
        return self.frames


def test_what_is_damaged_is_left_out_and_counted_and_sound_only_measured():
    stream = SimpleNamespace(index=0)
    packets = [
        Packet(0, False), Packet(1, True, False), Packet(2, error=True), Packet(90, stream=1),
        Packet(3, False),
    ]  # fmt: skip
    decoder = Decoder("film", stream)
    container = SimpleNamespace(start_time=None, demux=lambda: iter(packets))
    kept = [frame.pts for frame in decoder._decoded(container, stream)]
    assert kept == [0, 1, 3] and decoder.bad == 2 and decoder.packets == 4
    assert decoder.covered == pytest.approx(91 / 25)
