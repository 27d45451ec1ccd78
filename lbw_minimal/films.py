"""Films side by side, for notebooks and pages: in one piece of HTML that needs no other file.

In: frames (T, H, H, 3) uint8 of each film. Out: HTML with a looping video in it, which stands
still until asked where the reader's system asks for less motion. Its controls are below it: a
browser's own would hide the lower part of a small film. On paper, and where no video plays, a
picture stands in for it.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from fractions import Fraction
from html import escape
from typing import Any, cast

import av
import numpy as np
from av.video.stream import VideoStream
from PIL import Image

from lbw_minimal.pictures import data_uri, enlarge, png

SIDE = 252  # pixels of a film's side, 3 a pixel of the camera: keypoints can be told apart
GAP = 6  # pixels between two of them
REST = 1.0  # s for which the end stays before the film starts over
# VP9, which every browser plays without a licence: 70 kB for three films of two seconds, in 0.2 s.
CODEC = "libvpx-vp9"
FINE = {"crf": "34", "b:v": "0", "deadline": "realtime", "cpu-used": "8"}
CALM = "matchMedia('(prefers-reduced-motion: reduce)').matches && this.pause()"
FIND = "this.closest('.film').querySelector('{}')"
VIDEO, BUTTON, SLIDER = (FIND.format(name) for name in ("video", "button", "input"))
TOGGLE = f"const film = {VIDEO}; film.paused ? film.play() : film.pause()"
SEEK = f"const film = {VIDEO}; film.pause(); film.currentTime = this.value * film.duration"
SAY = f"{BUTTON}.textContent = this.paused ? 'Play' : 'Pause'"
MOVE = f"{SLIDER}.value = this.currentTime / this.duration"
STYLE = """<style>
.film { margin: .5rem 0 } .film video, .film img { width: 100%; display: block }
.film video { image-rendering: pixelated }
.film figcaption { display: flex; gap: .3rem; text-align: center }
.film figcaption span { flex: 1 1 0 }
.film .bar { display: flex; gap: .5rem; margin-top: .3rem }
.film button { min-width: 4.5rem } .film input { flex: 1; min-width: 0 }
@media not print { .film .still { display: none } }
@media print { .film video, .film .bar { display: none } }
</style>"""


class Film:
    """Films that run side by side; as a notebook's value it shows itself.

    films: name -> frames (T, H, H, 3) uint8, RGB; small ones are enlarged, and shorter ones wait at
    their end for the longest. fps: frames a second; 12.5 is half the speed of the kit's videos.
    """

    def __init__(self, films: Mapping[str, np.ndarray], fps: float = 12.5):
        self.names, self.fps = tuple(films), fps
        self.frames = side_by_side([*films.values()])

    def webm(self) -> bytes:
        """The films as one WebM file, and a second's rest at the end."""
        out = io.BytesIO()
        # Without "bitexact" the same film gets another number in each file.
        with av.open(out, "w", format="webm", options={"fflags": "+bitexact"}) as container:
            rate = Fraction(self.fps).limit_denominator(1000)
            stream = cast(VideoStream, container.add_stream(CODEC, rate=rate, options=FINE))
            stream.height, stream.width = self.frames.shape[1:3]
            stream.pix_fmt = "yuv420p"
            rest = np.repeat(self.frames[-1:], round(self.fps * REST), axis=0)
            for frame in (*self.frames, *rest):
                container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
            container.mux(stream.encode())
        return out.getvalue()

    def webp(self) -> bytes:
        """The films as an animated WebP, for a README, where no video plays: 250 kB for two s."""
        first, *rest = map(Image.fromarray, self.frames)
        out, times = io.BytesIO(), [round(1000 / self.fps)] * len(rest) + [round(1000 * REST)]
        how: dict[str, Any] = {"save_all": True, "append_images": rest, "loop": 0, "quality": 50}
        first.save(out, "WEBP", duration=times, **how)  # ms
        return out.getvalue()

    def html(self) -> str:
        """The film as a figure of a page."""
        said = f"A film of {', '.join(self.names)}"
        wide = self.frames.shape[2] * 5 // 4  # pixels: on a large screen a quarter larger
        names = "".join(f"<span>{escape(name)}</span>" for name in self.names)
        still = png(self.frames[len(self.frames) // 2])
        return (
            f'{STYLE}<figure class="film" style="max-width: {wide}px">'
            f"<figcaption>{names}</figcaption>"
            f'<video src="{data_uri("video/webm", self.webm())}" aria-label="{escape(said)}" '
            f'autoplay loop muted playsinline onloadeddata="{CALM}" onclick="{TOGGLE}" '
            f'onplay="{SAY}" onpause="{SAY}" ontimeupdate="{MOVE}"></video>'
            f'<div class="bar"><button type="button" onclick="{TOGGLE}">Pause</button>'
            '<input type="range" min="0" max="1" step="any" value="0" aria-label="Moment of the '
            f'film" oninput="{SEEK}"></div>'
            f'<img class="still" src="{still}" alt="{escape(said)}"></figure>'
        )

    _repr_html_ = html


def side_by_side(films: list[np.ndarray]) -> np.ndarray:
    """Films (T_i, H_i, H_i, 3) uint8 in one of height H, at least `SIDE`, with grey between them.

    An H_i that does not divide H is an error, ValueError.
    """
    high, long = max(SIDE, *(f.shape[1] for f in films)), max(map(len, films))
    between = np.full((long, high, GAP, 3), 128, np.uint8)
    columns = []
    for film in films:
        large = enlarge(film, high // film.shape[1])
        columns += [large[np.minimum(np.arange(long), len(film) - 1)], between]
    return np.concatenate(columns[:-1], axis=2)
