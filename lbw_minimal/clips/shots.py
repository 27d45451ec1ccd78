"""Pictures of a clip on its page: a click into one writes the option that corrects the clip.

In: the clip's frames, what was found in them if anything was, and the command that was run. Out:
HTML, with a script that adds to the command what is clicked.
"""

from __future__ import annotations

import json

import cv2
import numpy as np

from lbw_minimal.clips.paths import FADE, SURE, Tracks
from lbw_minimal.pictures import data_uri, spread

WIDE = 360  # pixels, the longer side of a frame of the clip
FRAMES = 12  # of the clip that the page shows
TIP, OBJECT = (213, 94, 0), (86, 180, 233)  # Okabe and Ito's vermilion and sky blue
FROM, TO = (255, 255, 255), (0, 0, 0)  # what marks the first and the last picture to use
STRIP = """
.clip { display: grid; grid-template-columns: repeat(auto-fill, minmax(15rem, 1fr)); gap: .6rem }
.clip.upright { grid-template-columns: repeat(auto-fill, minmax(9rem, 1fr)) }
.clip figure { margin: 0 }
.clip img { width: 100%; display: block; cursor: crosshair }
.clip .unused img { filter: grayscale(1) opacity(.4) }
label { display: inline-block; margin-right: .8rem }
td:first-child { white-space: nowrap }
.shot { display: block; position: relative }
.choice { position: sticky; top: 0; z-index: 1; max-width: none; padding: .3rem 0;
          background: var(--page) }  /* in sight at each picture */
.click { position: absolute; width: 12px; height: 12px; margin: -6px; border: 2px solid #000;
         border-radius: 50%; pointer-events: none; outline: 1px solid #fff }
@media print { .clicks { display: none } .clip { grid-template-columns: repeat(4, 1fr) }
               .clip.upright { grid-template-columns: repeat(6, 1fr) } }
"""


def _dot(colour, hollow=False, ring=None):
    """A dot of the legend, as HTML; ring: its edge's colour, if that is another one."""
    ink = f"rgb{colour}"
    fill = "none" if hollow else ink
    return (
        '<svg width="14" height="14" aria-hidden="true"><circle cx="7" cy="7" r="5" '
        f'fill="{fill}" stroke="{ring or ink}" stroke-width="2"/></svg>'
    )


LEGEND = f"""
<p>{_dot(TIP)} Orange is the tip, the point that pushes: a fingertip, or the foot or end of what the
hand holds. {_dot(OBJECT)} Sky blue is the object, the thing that is pushed; where none is, as
in reach, it counts for nothing. Of a full dot the network is sure, and may be wrong all the same:
look at each. Of a hollow one {_dot(TIP, True)} {_dot(OBJECT, True)} it is not sure. "Yours" is
where you clicked, and between your clicks. Grey pictures are not used.</p>
"""
CLICK = f"""
<p>Is a dot wrong? Choose which, click where it should be, and run the command below.</p>
<details><summary>How far a click reaches</summary>
<p>Another click into the same picture replaces the first. Two or three pictures are enough where a
dot is beside its place, the last picture among them if it is wrong there: between your first and
your last click the correction is interpolated. Beyond them it fades out: within {FADE:g} s where
the dot was full, by the next full dot where it was hollow, and where the clip jumps. All else stays
as it was found. So click also on a dot that is right, where a correction should end. Is a dot on
something else all along? Click into every picture until the last, from just before it should move,
or from the first if it never does.</p></details>
"""
CUT = """
<p>Is a part of the clip to be left out? Choose the first or the last picture to use, and click it.
Do so before you correct a dot: in what is left all is looked for anew, and dots that were right may
be others. The next page has as many pictures of it, closer together: so a fast hand can be clicked.
</p>
"""
ONLY_CUT = """
<p>Hand and object were not even looked for in this clip. If a part of it is as it should be, choose
the first and then the last picture of that part, click them, and run the command below.</p>
"""
CHOICES = {  # by the option that a click writes
    "tip": f"{_dot(TIP)} tip",
    "object": f"{_dot(OBJECT)} object",
    "from": f"{_dot(FROM, ring='grey')} first picture to use",
    "to": f"{_dot(TO, ring='grey')} last picture to use",
}
SCRIPT = """
<pre id="command"></pre>
<p id="swapped" class="note" hidden>The last picture to use lies before the first.</p>
<p class="clicks"><button id="copy">Copy</button> <button id="again">Start again</button></p>
<script>
const base = %s, colours = %s, marks = new Map();
const [pre, copy, again] = ["command", "copy", "again"].map(id => document.getElementById(id));
const show = () => {
  const words = [base, ...[...marks.values()].map(mark => mark.option)].join(" ").split(" ");
  pre.replaceChildren(...words.flatMap(word => {  // as in `shell`
    const span = document.createElement("span");
    Object.assign(span, {className: "word", textContent: word});
    return [span, " "];
  }).slice(0, -1));
  copy.textContent = "Copy";
  const [from, to] = ["from", "to"].map(key => marks.get(key)?.time);
  document.getElementById("swapped").toggleAttribute("hidden", !(+to < +from));
  document.getElementById("first")?.toggleAttribute("hidden", !marks.size);
};
document.querySelectorAll(".clip img").forEach(img => img.addEventListener("click", e => {
  const what = document.querySelector("[name=what]:checked").value, time = img.dataset.time;
  const whole = what === "from" || what === "to";  // the picture counts, not the place in it
  const box = img.getBoundingClientRect(), key = whole ? what : what + time;
  const x = Math.min(1, Math.max(0, (e.clientX - box.left) / box.width));
  const y = Math.min(1, Math.max(0, (e.clientY - box.top) / box.height));
  const place = [x * img.dataset.width, y * img.dataset.height].map(v => v.toFixed(0));
  const dot = marks.get(key)?.dot ?? document.createElement("i");
  dot.className = "click";
  dot.style = `left: ${100 * x}%%; top: ${100 * y}%%; background: ${colours[what]}`;
  img.after(dot);
  marks.set(key, {dot, time, option: `--${what} ${whole ? time : `${place}@${time}`}`});
  show();
}));
again.addEventListener("click", () => {
  marks.forEach(mark => mark.dot.remove());
  marks.clear();
  show();
});
copy.addEventListener("click", () => {  // the newer way asks for a secure page
  getSelection().selectAllChildren(pre);
  if (document.execCommand("copy")) copy.textContent = "Copied";
});
show();
</script>
"""


def to_correct(
    frames: np.ndarray,
    times: np.ndarray,
    tracks: Tracks | None,
    used: tuple[float, float] | None,
    command: str,
) -> list[str]:
    """The pictures, what can be clicked there, and the command with what a click adds to it.

    frames (T, H, W, 3) uint8, times (T,) s: the clip. Without tracks, which a clip has only if it
    was searched, a click can choose the seconds to use, and nothing else. used: as in
    `clip_frames`.
    """
    names = [*CHOICES] if tracks else ["from", "to"]
    radios = "\n".join(
        f'<label><input type="radio" name="what" value="{name}"{" checked" if not i else ""}> '
        f"{CHOICES[name]}</label>"
        for i, name in enumerate(names)
    )
    inks = zip(CHOICES, (TIP, OBJECT, FROM, TO), strict=True)
    colours = json.dumps({name: f"rgb{ink}" for name, ink in inks})
    script = SCRIPT % (json.dumps(command).replace("<", "\\u003c"), colours)
    said = CLICK + CUT if tracks else ONLY_CUT
    choice = f'<p class="clicks choice">{radios}</p>'
    shots = f"<div>{choice}{clip_frames(frames, times, tracks, used)}</div>"
    return [LEGEND if tracks else "", f'<div class="clicks">{said}</div>', shots, script]


def clip_frames(
    frames: np.ndarray,
    times: np.ndarray,
    tracks: Tracks | None = None,
    used: tuple[float, float] | None = None,
) -> str:
    """Frames of the clip with tip and object drawn on them, which know where they are clicked.

    used: the first and the last second that the motion shows; frames outside are grey.
    """
    figures = []
    slack = 0.5 * float(np.median(np.diff(times))) if used else 0.0
    clicked = [t for _, *ends in tracks.yours for t in ends] if tracks else []
    clicks = [int(np.abs(times - t).argmin()) for t in clicked]
    for i in sorted({*spread(len(times), FRAMES).tolist(), *clicks}):
        t, image = times[i], drawn(frames[i], tracks, i)
        file = cv2.imencode(".webp", image[..., ::-1])[1].tobytes()
        size = f'data-width="{frames.shape[2]}" data-height="{frames.shape[1]}"'
        inside = not used or used[0] - slack <= t <= used[1] + slack
        found = [f"{name} {_how_sure(tracks, name, i)}" for name in ("tip", "object") if tracks]
        caption = "; ".join([f"{t:.2f} s", *([", ".join(found)] if found else [])])
        caption += "" if inside else "; not used"
        figures.append(
            f'<figure{"" if inside else " class=unused"}><span class="shot">'
            f'<img alt="Frame at {t:.2f} s" data-time="{t:.3f}" {size} '
            f'src="{data_uri("image/webp", file)}"></span>'
            f"<figcaption>{caption}</figcaption></figure>"
        )
    upright = " upright" if frames.shape[1] > frames.shape[2] else ""
    return f'<div class="clip{upright}">{"".join(figures)}</div>'


def _how_sure(tracks, name, i):
    """What the caption of frame i says of the tip or the object, `name`."""
    if tracks.is_yours(name, i):
        return "yours"
    return f"{getattr(tracks, f'{name}_sure')[i]:.0%} sure"


def correctable(tracks: Tracks) -> list[str]:
    """Which of "tip" and "object" has dots that are not the user's, and so may be wrong."""
    every = range(len(tracks.times))
    names = "tip", "object"
    return [name for name in names if not all(tracks.is_yours(name, i) for i in every)]


def drawn(frame: np.ndarray, tracks: Tracks | None = None, i: int = 0) -> np.ndarray:
    """A frame at most WIDE pixels wide or high, with what was found at index i of the tracks."""
    scale = WIDE / max(frame.shape[:2])
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    small = cv2.resize(frame, None, fx=scale, fy=scale, interpolation=how)
    if tracks is not None:
        for name, paint in (("object", OBJECT), ("tip", TIP)):
            x, y = (scale * getattr(tracks, name)[i]).tolist()
            sure = getattr(tracks, f"{name}_sure")[i] >= SURE
            at = round(16 * x), round(16 * y)
            # The tip's dot is smaller: over the object's it leaves a ring of that.
            outer = 7 if name == "object" else 6
            for radius, ink in ((outer, (255, 255, 255)), (outer - 2, paint)):
                cv2.circle(small, at, 16 * radius, ink, -1 if sure else 1, cv2.LINE_AA, shift=4)
    return small
