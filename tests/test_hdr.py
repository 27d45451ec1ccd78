"""HDR on an ordinary screen: the standards' own numbers, and files as phones write them."""

import numpy as np
import pytest
from av.video.reformatter import ColorTrc
from toy_clips import encode

from lbw_minimal.clips import hdr
from lbw_minimal.clips.reader import read_clip


@pytest.mark.parametrize(
    "curve, signal, light",
    [  # BT.2408, table 1: cd/m2 of a screen of 1000 cd/m2, without and with the system's gamma
        (lambda e: 1000 * hdr.hlg_scene(e) ** 1.2, 0.75, 203),
        (lambda e: 1000 * hdr.hlg_scene(e) ** 1.2, 0.38, 26),
        (lambda e: 1000 * hdr.hlg_scene(e) ** 1.2, 1.0, 1000),
        (lambda e: 100 * hdr.pq_light(e), 0.58, 203),
        (lambda e: 100 * hdr.pq_light(e), 0.38, 26),
        (lambda e: 100 * hdr.pq_light(e), 1.0, 10000),
        (lambda e: 100 * hdr.pq_light(e), 0.0, 0),
    ],
)
def test_curves_meet_the_standards_levels(curve, signal, light):
    assert curve(np.float64(signal)) == pytest.approx(light, rel=0.02)


def test_the_curves_are_called_as_files_call_them():
    """ITU-T H.273's numbers, as FFmpeg has them, too."""
    assert (hdr.HLG, hdr.PQ) == (18, 16)
    names = {name: int(value) for name, value in ColorTrc.__members__.items()}
    assert (names["ARIB_STD_B67"], names["SMPTE2084"]) == (hdr.HLG, hdr.PQ)


def test_both_pieces_of_hlg_meet():
    assert hdr.hlg_scene(np.array([0.5, 0.5 + 1e-9])) == pytest.approx([1 / 12, 1 / 12], rel=1e-6)


def test_grey_stays_grey_and_light_is_that_of_the_screen():
    grey = np.full((1, 3), round(0.75 * 65535), np.uint16)
    assert hdr.screen_light(grey, hdr.HLG) == pytest.approx(2.03, rel=0.01)
    assert hdr.screen_light((grey * 0.58 / 0.75).astype(np.uint16), hdr.PQ) == pytest.approx(
        2.03, rel=0.02
    )


def test_wide_red_is_redder_than_the_screen_has():
    """BT.2020's (0.6274, 0.0691, 0.0164) is BT.709's red: its primaries in linear light."""
    red = np.array([[0.6274, 0.0691, 0.0164]], np.float32) @ hdr.TO_BT709.T
    assert red == pytest.approx(np.array([[1, 0, 0]]), abs=1e-3)


def test_shadows_stay_and_highlights_roll_off_to_the_peak():
    light = np.array([0.0, 0.1, 0.4, 1.0, 3.0, 10.0], np.float32)[:, None].repeat(3, axis=1)
    grey = hdr.tone_map(light, 1.0)[:, 0]
    assert grey[:3].tolist() == [0, 98, 174]  # 0, 0.1 and 0.4 to the power of 1 / 2.4
    assert grey[3] == 227 and grey[-1] == 255 and (np.diff(grey.astype(int)) > 0).all()


def test_the_screens_gamma_is_that_of_luminance():
    """HLG red, full signal: 10 E Y^0.2, Y = 0.2627, in BT.709's primaries, none below 0."""
    red = np.array([[65535, 0, 0]], np.uint16)
    light = 10 * 0.2627**0.2
    wanted = np.clip(light * hdr.TO_BT709[:, 0], 0, None)
    assert hdr.screen_light(red, hdr.HLG)[0] == pytest.approx(wanted, rel=1e-4)
    blue = np.array([[0, 0, 65535]], np.uint16)
    light = 10 * 0.0593**0.2
    assert hdr.screen_light(blue, hdr.HLG)[0, 2] == pytest.approx(1.1187 * light, rel=1e-4)


def test_white_is_what_99_of_100_pixels_stay_below():
    light = np.full((10, 100, 3), 0.5)
    light.reshape(-1, 3)[:5] = 9  # a lamp
    assert hdr.white_of(light) == 1.0
    light.reshape(-1, 3)[:20, 1] = 1.7  # a sheet of paper; the brightest colour counts
    assert hdr.white_of(light) == pytest.approx(1.7)
    light[:] = 9
    assert hdr.white_of(light) == 2.03


def test_light_is_counted_from_white():
    """Paper at twice white is shown as paper at white is, but for the peak it rolls off to."""
    light = np.full((1, 3), 0.4, np.float32)
    assert hdr.tone_map(2 * light, 2.0).tolist() == hdr.tone_map(light, 1.0).tolist()


def test_hue_stays_where_it_is_too_bright():
    (r, g, b), = hdr.tone_map(np.array([[8.0, 4.0, 0.0]], np.float32), 1.0)  # fmt: skip
    assert r > 240 and b == 0
    linear = (np.array([r, g]) / 255) ** 2.4
    assert linear[1] / linear[0] == pytest.approx(0.5, abs=0.02)


def test_white_is_paper_or_that_of_an_sdr_film():
    assert hdr.white_of(np.full((4, 4, 3), 0.3)) == 1.0
    assert hdr.white_of(np.full((4, 4, 3), 1.5)) == 1.5
    assert hdr.white_of(np.full((4, 4, 3), 9.0)) == hdr.WHITE


def hlg_signal(light):
    """The HLG signal (..., 3) uint16 of a screen's light, linear BT.709 RGB in 100 cd/m2."""
    wide = light / 10 @ np.linalg.inv(hdr.TO_BT709.T.astype(float))
    luminance = wide @ hdr.LUMINANCE
    scene = np.clip(wide * luminance[..., None] ** (1 / 1.2 - 1), 0, 1)
    signal = np.where(
        scene <= 1 / 12,
        np.sqrt(3 * scene),
        0.17883277 * np.log(12 * np.maximum(scene, 1 / 12) - 0.28466892) + 0.55991073,
    )
    return np.rint(65535 * signal).astype(np.uint16)


@pytest.mark.parametrize("codec", ["libx265", "ffv1"])
def test_a_phones_hlg_has_the_colours_of_the_scene(tmp_path, codec):
    colours = np.array([(150, 110, 90), (60, 60, 60), (40, 120, 60), (30, 60, 140)], np.uint8)
    picture = np.repeat(colours, 40, axis=0)[None].repeat(96, axis=0)  # (96, 160, 3)
    frames = hlg_signal((picture / 255) ** 2.4)[None].repeat(3, axis=0)

    def hdr_film(stream):
        context = stream.codec_context
        context.color_trc, context.color_primaries, context.colorspace = hdr.HLG, 9, 9

    def hdr_frame(frame):
        frame.color_trc, frame.color_primaries, frame.colorspace = hdr.HLG, 9, 9

    options = {"x265-params": "log-level=none:crf=10"} if codec == "libx265" else {}
    path = tmp_path / ("a.mov" if codec == "libx265" else "a.mkv")
    encode(
        path, frames, codec, fmt="yuv420p10le", options=options, prepare=hdr_film, mark=hdr_frame
    )
    clip = read_clip(path)
    assert clip.notes == ["HDR (HLG) was tone-mapped to the colours of an ordinary screen."]
    for i, colour in enumerate(colours):
        seen = clip.frames[1, 30:60, 40 * i + 10 : 40 * i + 30].mean(axis=(0, 1))
        assert np.abs(seen - colour).max() < 3
