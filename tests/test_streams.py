"""Which of a file's streams is the clip, and how fast it was, told of films that nobody decodes."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from lbw_minimal.clips import reader
from lbw_minimal.clips.decoding import Stream
from lbw_minimal.clips.reader import read_clip
from lbw_minimal.training import InputError

MOVES = np.repeat(np.arange(0, 200, 20, np.uint8), 4 * 4 * 3).reshape(10, 4, 4, 3)
STILL = np.zeros_like(MOVES)
BROKEN = None


@pytest.fixture
def read(monkeypatch):
    """Reads a file whose streams are [(frames, width), ...]; which was taken, and the clip."""

    def read(streams, rate=25.0, said=None):
        known = [Stream(i, width, 2, 1.0, rate, 0.4) for i, (_, width) in enumerate(streams)]

        def decoded(path, stream, *how):
            frames = streams[stream.index][0]

            def decode():
                if frames is BROKEN:
                    raise InputError(f"stream {stream.index} cannot be decoded")

            return SimpleNamespace(
                read=decode, frames=frames, stamps=list(np.arange(10) / rate), stream=stream,
                every=1, start=0.0, notes=[f"stream {stream.index}"], losses=[],
            )  # fmt: skip

        monkeypatch.setattr(reader, "look", lambda path: (known, said or {}))
        monkeypatch.setattr(reader, "_Film", decoded)
        monkeypatch.setattr(reader.motion, "moves", lambda frames: bool(frames.any()))
        clip = read_clip("a.mp4", cuts=False)
        return clip.notes[0], clip

    return read


@pytest.mark.parametrize(
    ("streams", "taken"),
    [
        ([(STILL, 900), (MOVES, 300), (MOVES, 600)], 2),  # motion first, then size
        ([(MOVES, 600), (MOVES, 300), (STILL, 900)], 0),
        ([(STILL, 300), (STILL, 600)], 1),
        ([(BROKEN, 900), (MOVES, 300)], 1),
        ([(STILL, 300)], 0),
    ],
)
def test_of_a_files_streams_the_widest_that_moves_is_taken(read, streams, taken):
    assert read(streams)[0] == f"stream {taken}"


def test_a_file_whose_streams_are_all_broken_says_why_the_first_is(read):
    with pytest.raises(InputError, match="stream 0"):
        read([(BROKEN, 900), (BROKEN, 300)])


@pytest.mark.parametrize(
    ("captured", "rate", "speed"),
    [
        ("120", 30.0, 4),  # a phone's slow motion
        ("120", 60.0, 1),  # twice is what it may be played at, too
        ("121", 60.0, 121 / 60),
        ("99", 25.0, 1),
        ("", 30.0, 1),
    ],
)
def test_slow_motion_has_100_frames_a_second_and_more_than_twice_what_is_played(
    read, captured, rate, speed
):
    said = {reader.CAPTURED: captured} if captured else {}
    _, clip = read([(MOVES, 300)], rate, said)
    assert clip.times[-1] == pytest.approx(9 / rate / speed)
    assert ("Slow motion" in clip.notes[-1]) == (speed > 1)


@pytest.mark.parametrize(("seconds", "looked"), [(46, False), (47, True)])
def test_only_a_film_that_memory_does_not_hold_is_looked_through_first(
    monkeypatch, seconds, looked
):
    """At 320 by 180 pixels and 25 frames a second 200 MB are 46.3 s."""
    asked = []
    monkeypatch.setattr(reader, "Decoder", lambda *how, **more: asked.append(how) or [])
    stream = Stream(0, 1920, 1080, 1.0, 30.0, seconds)
    film = reader._Film(Path("a.mp4"), stream, None, None, None, True)
    monkeypatch.setattr(film, "_choose", lambda stamps, frames: "looked")
    film._by_key_frames()
    assert bool(asked) == looked
