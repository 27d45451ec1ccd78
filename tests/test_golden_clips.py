"""A clip is read, stood upright and checked as it was when the shipped results were made."""

import contextlib
from types import SimpleNamespace

import av
import cv2
import numpy as np
import pytest

from lbw_minimal.clips import arms, decoding, footage, hdr, lookalike, reader, stills, upright
from lbw_minimal.clips.decoding import Decoder, Stream, look
from lbw_minimal.training import InputError
from tests.toy_chance import cells
from tests.toy_clips import add, add_sound, arm, encode, reach, room

LEVELS = {"rtol": 1e-3, "atol": 1.0}  # grey levels: FFmpeg's releases round otherwise

# Colours


def test_light_becomes_a_picture_as_it_did(golden):
    codes = np.linspace(0, 65535, 13).round().astype(np.uint16)
    colours = np.stack([codes, codes[::-1], np.roll(codes, 4)], 1)
    unit, light = np.linspace(0, 1, 21), {}
    for name, transfer in (("HLG", hdr.HLG), ("PQ", hdr.PQ)):
        light[name] = hdr.screen_light(colours, transfer)
        light[f"{name} shown"] = hdr.tone_map(light[name].copy(), 1.4)
        light[f"{name} white"] = hdr.white_of(light[name] / 3)
    bright = np.outer(np.linspace(0.01, 12, 15), (1, 0.6, 0.2)).astype(np.float32)
    golden(
        light | {
            "scene": hdr.hlg_scene(unit), "pq": hdr.pq_light(unit), "sdr": hdr.sdr_signal(unit),
            "rolled off": hdr._roll_off(np.linspace(0, 4, 17), 4.0),
            "highlights": hdr.tone_map(bright, 1.0), "table": hdr._sdr()[:: 1 << 16],
        }
    )  # fmt: skip


def side_data(a, b, c, d):
    matrix = np.array([a, b, 0, c, d, 0, 0, 0, 1], np.int32) * 65536
    return {"DISPLAYMATRIX": matrix.tobytes()}


TURNS = {(a, b, c, d) for a, b, c, d in (
    (1, 0, 0, 1), (0, 1, -1, 0), (-1, 0, 0, -1), (0, -1, 1, 0),
    (-1, 0, 0, 1), (0, 1, 1, 0), (1, 0, 0, -1), (0, -1, -1, 0),
)}  # fmt: skip


@pytest.mark.parametrize("turn", sorted(TURNS))
def test_pictures_are_stood_upright_in_all_eight_ways(turn, golden):
    """Wider than high, with another colour in each corner; and a window that is off the middle."""
    picture = cv2.resize(room(9, 16), (640, 400), interpolation=cv2.INTER_CUBIC)
    given = av.VideoFrame.from_ndarray(picture, format="rgb24")
    frame = SimpleNamespace(width=640, height=400, colorspace=1, color_trc=1,
                            side_data=side_data(*turn))  # fmt: skip
    figures = {}
    for name, window, pixel in (
        ("whole", upright.WHOLE, 1.0),
        ("part", (0.1, 0.8, 0.2, 0.95), 1.3),
    ):
        up = upright.Upright(Stream(0, 640, 400, pixel, 25.0, 1.0), None, window)
        scaler = up._scaler
        up._scaler = SimpleNamespace(reformat=lambda frame, *, s=scaler, **how: s.reformat(
            given, **how))  # fmt: skip
        shown = up(frame)
        figures |= {f"{name} shape": shown.shape, name: cells(shown.mean(2), 3),
                    f"{name} notes": up.notes, f"{name} bytes": up.bytes}  # fmt: skip
    golden(figures, **LEVELS)


def test_a_phones_hdr_and_its_fade_in_are_shown_as_they_were(golden):
    """Ten times darker, a fade-in, and then with a white of its own."""
    base = cv2.resize(room(9, 16), (64, 36), interpolation=cv2.INTER_CUBIC).astype(np.uint16) * 256
    figures = {}
    for transfer in (hdr.HLG, hdr.PQ):
        up = upright.Upright(Stream(0, 64, 36, 1.0, 25.0, 1.0))
        for i, share in enumerate((0.05, 1.0, 0.6)):
            frame = av.VideoFrame.from_ndarray((base * share).astype(np.uint16), format="rgb48le")
            frame.color_trc = transfer
            figures[f"{transfer} {i}"] = [up._white or -1, *cells(up(frame), 2)]
        figures[f"{transfer} notes"] = up.notes
    golden(figures, **LEVELS)


def test_borders_are_found_as_they_were(golden):
    rng, figures = np.random.default_rng(0), {}
    frames = np.clip(rng.normal(110, 30, (70, 60, 90, 3)), 0, 255).astype(np.uint8)
    for name, (top, bottom, left, right), level in (
        ("both", (9, 52, 12, 80), 20), ("upper", (13, 60, 0, 90), 10),
        ("left", (0, 60, 30, 90), 0), ("one line", (1, 60, 0, 90), 0),
        ("grey", (9, 52, 12, 80), 26), ("half", (28, 60, 0, 90), 0),
    ):  # fmt: skip
        film = frames.copy()
        film[:, :top] = film[:, bottom:] = film[:, :, :left] = film[:, :, right:] = level
        film[::9, top : top + 1, left:right] //= 3  # coding softens the edge
        figures[name] = upright.borders(film)
    golden({name: value or "none" for name, value in figures.items()})


# Files


FILES = {
    "a.mp4": dict(options={"g": "12", "sc_threshold": "0"}, rate=30),
    "a.ts": dict(codec="mpeg2video"),
    "a.mkv": dict(codec="ffv1", times=np.cumsum(np.r_[0.3, np.tile([0.03, 0.06, 0.2], 15)[:44]])),
    "a.avi": dict(codec="mpeg4", options={"g": "30"}),
    "a.mpg": dict(codec="mpeg2video", options={"flags": "+ildct+ilme", "b": "4M"}),
}


@pytest.mark.parametrize("name", FILES)
def test_files_are_decoded_with_the_times_they_had(name, tmp_path, golden):
    """As a whole, from a second on, and by key frames alone."""
    path, figures = encode(tmp_path / name, reach(45), **FILES[name]), {}
    (stream,), _ = look(path)
    for how, options in (("all", {}), ("late", {"start": 1.0}), ("sparse", {"sparse": True})):
        decoder = Decoder(path, stream, **options)
        shown = list(decoder)
        times = np.array([np.nan if time is None else time for time, _ in shown])
        counted = [decoder.packets, decoder.bad, decoder.interlaced]
        counted += [decoder.promised, decoder.covered]
        figures[how] = [len(times), *times[:: max(1, len(times) // 6)], *counted]
    figures["stream"] = [stream.index, stream.width, stream.height, stream.pixel, stream.rate,
                         stream.seconds]  # fmt: skip
    golden(figures, atol=1e-3)


def test_a_file_of_several_streams_is_described_as_it_was(tmp_path, golden):
    path = tmp_path / "a.mp4"
    with av.open(str(path), "w") as out:
        packets = add_sound(out, 2.0)
        packets += add(out, reach(20)[:, :48], "mpeg4", 20)
        packets += add(out, reach(30), "libx264", 25)
        for packet in packets:
            out.mux(packet)
    streams, _ = look(path)
    figures = {f"stream {s.index}": [s.width, s.height, s.pixel, s.rate, s.seconds]
               for s in streams}  # fmt: skip
    clip = reader.read_clip(path)
    with av.open(str(tmp_path / "a.avi"), "w") as out:  # its sound goes on
        packets = add_sound(out, 2.0) + add(out, reach(30), "mpeg4", 25)
        for packet in packets:
            out.mux(packet)
    (longer,), _ = look(tmp_path / "a.avi")
    decoder = Decoder(tmp_path / "a.avi", longer)
    figures["avi"] = [len(list(decoder)), longer.seconds, decoder.promised, decoder.covered]
    with av.open(str(tmp_path / "a.mkv"), "w") as out:  # its pictures begin after its sound
        packets = add_sound(out, 2.0) + add(out, reach(20), "mpeg4", 25, 0.4 + np.arange(20) / 25)
        for packet in sorted(packets, key=lambda packet: packet.pts * packet.time_base):
            out.mux(packet)
    (late,), _ = look(tmp_path / "a.mkv")
    figures["begins late"] = [time for time, _ in Decoder(tmp_path / "a.mkv", late)][::5]
    decoder = Decoder(path, streams[0])
    figures["decoded"] = [len(list(decoder)), decoder.packets, decoder.covered, decoder.promised]
    golden(figures | {"notes": clip.notes, "shape": clip.frames.shape}, atol=1e-3)


def test_a_stream_without_a_size_is_no_film(monkeypatch, tmp_path):
    def stream(index, width, height):
        return SimpleNamespace(
            index=index, disposition=0, sample_aspect_ratio=None, average_rate=25, duration=None,
            codec_context=SimpleNamespace(width=width, height=height),
        )  # fmt: skip

    def told(*streams):
        whole = SimpleNamespace(
            format=SimpleNamespace(name="mov"), streams=SimpleNamespace(video=streams, audio=()),
            duration=3_000_000, metadata={"a": "b"},
        )  # fmt: skip
        monkeypatch.setattr(decoding, "_open", lambda file: contextlib.nullcontext(whole))
        found, said = look(tmp_path / "a.mp4")
        assert said == {"a": "b"} and {one.seconds for one in found} == {3.0}
        return [one.index for one in found]

    (tmp_path / "a.mp4").write_bytes(bytes(range(256)))
    assert told(stream(0, 0, 6), stream(1, 8, 6), stream(2, 8, 0)) == [1]
    with pytest.raises(InputError, match="cut short or damaged"):
        told(stream(0, 0, 6), stream(1, 0, 0))


@pytest.mark.parametrize(("covered", "refused"), [(0.82, False), (0.78, True)])
def test_of_a_short_film_a_frame_and_a_tenth_of_a_second_may_be_missing(covered, refused):
    """At 10 frames a second."""
    film = reader._Film("a.mp4", Stream(0, 8, 6, 1.0, 10.0, 1.0), None, None, None, True)
    decoder = SimpleNamespace(promised=1.0, covered=covered, packets=8)
    with (
        pytest.raises(InputError, match=r"promises 1\.0 s and 0\.8 s can")
        if refused
        else (contextlib.nullcontext())
    ):
        film._check(decoder, 8, True)


def test_a_text_that_ends_within_a_letter_is_text():
    text = ("Där Arm schiebt. " * 9 + "ä").encode()
    assert decoding._is_text(text[:-1]) and not decoding._is_text(text[:-1] + b"\xff\x00")


def boxed(n=50):
    """A reach between black bars, rather large, as it is filmed upright."""
    film = np.zeros((n, 180, 360, 3), np.uint8)
    film[:, 20:164, 40:] = arm(np.linspace(0.1, 0.6, n), room(144, 320))
    return film


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    path = tmp_path_factory.mktemp("clips") / "a.mkv"
    times = 0.1 + np.cumsum(np.r_[0, np.tile([0.04, 0.08, 0.04], 20)[:49]])
    return encode(path, boxed(), "ffv1", times=times)


@pytest.mark.parametrize(
    "asked", [{}, {"start": 0.4, "end": 1.5}, {"turn": 90, "crop": False}, {"turn": 270}]
)
def test_a_clip_is_read_as_it_was(asked, film, golden):
    clip = reader.read_clip(film, **asked)
    golden(
        {
            "shape": clip.frames.shape, "times": clip.times[::4], "notes": clip.notes,
            "losses": clip.losses, "first": cells(clip.frames[0].mean(2), 4),
            "last": cells(clip.frames[-1].mean(2), 4),
        },
        **LEVELS | {"atol": 0.02},
    )  # fmt: skip


def test_a_film_that_memory_does_not_hold_is_read_where_it_moves_as_it_was(
    tmp_path, monkeypatch, golden
):
    """A minute at 5 frames a second, in which an arm moves twice, and room for a few of them."""
    shares = np.interp(np.arange(300) / 5, [0, 9, 11, 30, 33, 60], [0.1, 0.1, 0.3, 0.3, 0.7, 0.7])
    path, figures = encode(tmp_path / "a.mp4", arm(shares), rate=5, options={"g": "5"}), {}
    for frames in (40, 200):
        monkeypatch.setattr(reader, "MOST", frames * 3 * 96 * 160)
        for name, asked in (("all", {}), ("asked", {"start": 2.0})):
            clip = reader.read_clip(path, **asked, cuts=False)
            levels = clip.frames[0].mean(), clip.frames[-1].mean()
            figures[f"{name} {frames}"] = [len(clip.frames), *clip.times[[1, -1]], *levels]
            figures[f"{name} {frames} losses"] = clip.losses
    golden(figures, atol=0.1)


def test_times_are_put_in_order_and_taken_25_times_a_second_as_they_were(golden):
    steps = np.tile([0.03, 0.05, 0.01, 0.09], 12)
    back = np.cumsum(steps)
    back[20:] -= 4.0
    film = SimpleNamespace(stamps=back.tolist(), every=2, frames=back, losses=[],
                           stream=SimpleNamespace(rate=24.0))  # fmt: skip
    stands = SimpleNamespace(**vars(film) | {"stamps": [0.0] * 30 + back[:18].tolist()})
    unknown = SimpleNamespace(**vars(film) | {"stamps": [None, *back[1:]], "losses": []})
    clip = reader.Clip(np.arange(48)[:, None], np.cumsum(steps), [7, 30], [], [])
    longest = reader.steady(clip)
    golden(
        {
            "back": reader._rising(film)[::4], "stands": reader._rising(stands)[::4],
            "unknown": reader._rising(unknown)[::4], "losses": film.losses + unknown.losses,
            "shown": reader.resample(np.cumsum(steps) - 0.03),
            "at 10": reader.resample(np.cumsum(steps) - 0.03, 10.0),
            "steady": [*longest.frames[[0, -1], 0], *longest.times[[0, -1]]],
        }
    )  # fmt: skip


# What moves, and where an arm comes in


def test_things_hang_together_and_are_at_an_edge_as_they_were(golden):
    """Blobs at each edge, large and small, near and off it, and gaps of 8 and 9 pixels."""
    rng, figures = np.random.default_rng(0), {}
    for t in range(0, 24, 4):
        moved = np.zeros((84, 84), bool)
        x, y = rng.integers(0, 70, 2)
        w, h = rng.integers(4, 40, 2)
        moved[y % 12 : y % 12 + h, x : x + w] = True
        moved[50 : 50 + t, : 2 * t] = True
        moved[80:, 84 - t :] = True
        moved[30:50, 76 - t % 9 :] |= t % 3 == 0
        moved[8:30, 60 : 78 + t % 7] |= t % 4 == 1
        labels, stats = footage.things(moved)
        figures[f"things {t}"] = [labels.max(), *stats.ravel()]
    at = [
        footage.at_edge(*box)
        for box in (
            (3, 9, 9, 9), (4, 9, 9, 9), (9, 3, 9, 9), (9, 9, 72, 9), (9, 9, 71, 9), (9, 9, 9, 72),
        )
    ]  # fmt: skip
    golden(figures | {"at edge": at})


def test_arms_come_in_where_they_did(golden):
    """Strips of all sizes and sureness, at each edge and off it."""
    rng, masks = np.random.default_rng(0), np.zeros((40, 32, 42), np.float32)
    for t, mask in enumerate(masks):
        for _ in range(1 + t % 3):
            x, y = rng.integers(0, 36), rng.integers(0, 4)
            mask[y : y + rng.integers(4, 24), x : x + rng.integers(2, 9)] = rng.uniform(0.4, 1)
        mask[10 : 10 + t % 7, : t % 11] = 0.9
    figures = {
        str(t): np.ravel(arms._coming_in(arms._pieces(mask))) for t, mask in enumerate(masks)
    }
    off = 6.0 * np.stack([cv2.resize(mask, (84, 84)) for mask in masks]) ** 3 * 4
    parts = [arms.count(masks[t : t + 10], off[t : t + 10]) for t in range(0, 40, 5)]
    golden(figures | {"count": np.ravel(parts)})


def test_a_clip_that_was_steadied_is_looked_at_again_and_only_in_its_longest_shot(monkeypatch):
    looked, frames = [], np.zeros((50, 8, 8, 3), np.uint8)
    still, steady = np.zeros((3, 84, 84)), frames + 1

    def look_at(shot):
        looked.append((len(shot), int(shot.max())))
        return still, still[0], True

    asked = []
    monkeypatch.setattr(footage, "before_background", look_at)
    monkeypatch.setattr(
        footage, "_steadied", lambda *of: asked.append(of[1:]) or (steady, ["sways"])
    )
    seen = footage.check(frames, [10, 41])
    assert looked == [(31, 0), (31, 1)] and asked == [([(0, 10), (10, 41), (41, 50)], 1)]
    assert seen.frames is steady and seen.warnings == ["sways"] and seen.shot == slice(10, 41)


def test_what_stays_changed_is_told_as_it_was(golden):
    """Things of some sizes, which appear in the middle, at an edge, or in the last frames alone."""
    figures = {}
    for side in (4, 5, 6, 7, 20):
        for where in (2, 30):
            for last in (1, 2, 3, 40):
                for n in (20, 40):
                    still = np.zeros((n, 84, 84), np.float32)
                    still[-last:, 30 : 30 + side, where : where + side] = 30
                    figures[f"{side} {where} {last} {n}"] = footage._unmoved(still)
    golden({"unmoved": "".join("01"[one] for one in figures.values())})


# Clips for the course


def test_a_look_alike_is_made_and_kept_as_it_was(tmp_path, golden):
    rng = np.random.default_rng(0)
    wall = cv2.resize(room(12, 12, 5), (84, 84), interpolation=cv2.INTER_CUBIC)
    frames, pixels = np.repeat(wall[None], 30, axis=0), rng.uniform(10, 70, (30, 4))
    clip = lookalike.look_alike(frames, pixels, 2)
    lookalike.write(tmp_path / "a.mp4", clip)
    back = reader.read_clip(tmp_path / "a.mp4", crop=False, cuts=False)
    golden(
        {
            "times": clip.times[::3], "tip": clip.tip[::3], "object": clip.object[::3],
            "light": clip.frames.mean((1, 2, 3))[::3], "shape": clip.frames.shape,
            "colours": clip.frames.mean((0, 1, 2)), "noise": clip.frames[1].std(),
            "picture": cells(clip.frames[2].mean(2)), "read": back.times[::3],
        },
        rtol=1e-3, atol=2e-3,
    )  # fmt: skip


def test_stills_are_kept_as_large_and_as_good_as_they_were(tmp_path, golden):
    strip = np.stack([cv2.GaussianBlur(room(64, 64, seed), (0, 0), 1) for seed in range(3)])
    stills.write_stills(tmp_path / "a.webp", strip)
    back = stills.read_stills(tmp_path / "a.webp")
    off = np.abs(back.astype(float) - strip).mean((1, 2, 3))
    golden({"bytes": (tmp_path / "a.webp").stat().st_size, "off": off, "shape": back.shape},
           rtol=0.05)  # fmt: skip
    stills.write_stills(tmp_path / "a.webp", strip[:0])
    assert stills.read_stills(tmp_path / "a.webp") is None and not list(tmp_path.iterdir())
