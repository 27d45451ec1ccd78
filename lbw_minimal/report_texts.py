"""What the page of a run says, and its style sheet.

Texts that depend on the method have its name as a key; where both rivals share one, it is "rival".
"""

from __future__ import annotations

from html import escape

CSS = """
:root { color-scheme: light; --page: #fff; --ink: #1b1b1b; --soft: #555; --panel: #f2f4f7;
        --line: #ddd; --note: #fff3d6; --link: #0b57d0 }
@media screen and (prefers-color-scheme: dark) {
  :root { color-scheme: dark; --page: #16181c; --ink: #e8e8e8; --soft: #b4b9c1; --panel: #252930;
          --line: #454b55; --note: #3f3214; --link: #8ab4f8 }
}
* { box-sizing: border-box }
body { margin: 0 auto; max-width: 56rem; padding: 1rem 1rem 4rem; background: var(--page);
       color: var(--ink); font: 1rem/1.55 system-ui, sans-serif }
a { color: var(--link) }
nav code { white-space: nowrap }
nav { display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; font-size: .85rem; color: var(--soft) }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 1rem 0 .5rem }
h2 { font-size: 1.25rem; margin: 2.6rem 0 .4rem; padding-top: 1.2rem;
     border-top: 1px solid var(--line) }
p, ol { max-width: 44rem; margin: .5rem 0 }
img, iframe { max-width: 100%; border: 0; display: block }
img { cursor: zoom-in } img:fullscreen { cursor: zoom-out }
iframe { width: 100%; height: min(26rem, 65vh) }
.tiles, .row { display: flex; flex-wrap: wrap; gap: .75rem; margin: 1rem 0 }
.tiles div { flex: 1 1 8rem; background: var(--panel); border-radius: 8px; padding: .6rem .9rem }
.tiles b { display: block; font-size: 1.35rem; white-space: nowrap }
.tiles span, figcaption, .small { color: var(--soft); font-size: .85rem }
.row > img { flex: 1 1 20rem; min-width: 0 }
.strip { display: grid; grid-template-columns: repeat(8, 1fr); gap: .5rem .3rem; margin: 1rem 0 }
@media (max-width: 40rem) { .strip { grid-template-columns: repeat(4, 1fr) } }
.strip figure { margin: 0; text-align: center }
.strip img { width: 100% }
.note { background: var(--note); border-left: 4px solid #E69F00; padding: .5rem .9rem }
table { border-collapse: collapse; margin: .8rem 0; font-size: .92rem; display: block;
        overflow-x: auto }
th, td { text-align: left; padding: .25rem 1.1rem .25rem 0; border-bottom: 1px solid var(--line) }
pre { white-space: pre-wrap; overflow-wrap: anywhere; background: var(--panel);
      border-radius: 8px; padding: .7rem .9rem }
.word { display: inline-block; max-width: 100% }
.still { display: none }
@media print { nav, .scene, iframe { display: none } .still { display: block }
               body { font-size: .85rem; padding: 0 } h2 { margin-top: 1.2rem }
               h1, h2, h2 + p, p:has(+ pre), p:has(+ img) { break-after: avoid }
               p, li, pre, h2, figure, img, tr, table { break-inside: avoid }
               img { max-height: 9cm; max-width: 100% } }
"""

HTML = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{css}</style>
</head>
<body>
{links}<main>
{body}
</main>
<script>
addEventListener("click", ({{target}}) => {{  // a picture is shown as large as the screen, and back
  if (document.fullscreenElement) document.exitFullscreen();
  else if (target.matches("img:not(.clip img)")) target.requestFullscreen?.();
}});
</script>
</body>
</html>
"""


def shell(lines: str) -> str:
    """Lines for a terminal as HTML."""
    return f"<pre>{chr(10).join(map(options, lines.splitlines()))}</pre>"


def options(line: str) -> str:
    """A line, or a part of one, as HTML. A word breaks only where it is longer than the page is
    wide, since a browser would break an option at its hyphens."""
    return " ".join(f'<span class="word">{escape(word)}</span>' for word in line.split(" "))


INTRODUCTION = {
    "lbw": """
<p>A human arm did the task once, in front of a camera. From that video a robot is to learn
it:</p>
<ol>
<li>A first network <b>translates</b> the video: it repaints the human arm as the robot's.</li>
<li>A second one finds <b>keypoints</b> on the translated video: a few spots that follow arm and
object. Nobody told it which.</li>
<li>The robot tries, over and over. The nearer its own keypoints come to the demonstrated ones,
the higher its <b>reward</b>.</li>
</ol>
<p>No action of the human was recorded, and nobody told the robot what success is.</p>
""",
    "avid": """
<p>AVID-m, a rival in the paper. A human arm did the task fifteen times in front of a camera:</p>
<ol>
<li>A first network, CycleGAN, <b>translates</b> the videos: it repaints the human arm as the
robot's.</li>
<li>A second one, the <b>goal classifier</b>, learns to tell the last tenth of the translated videos
from the rest.</li>
<li>The robot tries, over and over. The more its picture looks like an end to the classifier, the
higher its <b>reward</b>. It sees whole pictures, no keypoints.</li>
</ol>
<p>No action of the human was recorded, and nobody told the robot what success is.</p>
""",
    "classifier": """
<p>Classifier reward, a rival in the paper. The robot itself was led through the task thirty-five
times, in front of its own camera:</p>
<ol>
<li>A network, the <b>goal classifier</b>, learns to tell the last tenth of these videos from the
rest.</li>
<li>The robot tries, over and over. The more its picture looks like an end to the classifier, the
higher its <b>reward</b>. It sees whole pictures, no keypoints.</li>
</ol>
<p>No action was recorded. Nothing is translated either: this rival needs a robot that can do the
task already.</p>
""",
    "tracks": """
<p>After the paper: track, do not translate. A human arm did the task once, in front of a
camera:</p>
<ol>
<li>The <b>object</b> is found in that video: the points that rest first, move later, and move
together. No network is trained for it.</li>
<li>The robot finds the object in its own picture by its looks and <b>tracks</b> it.</li>
<li>The robot tries, over and over. The nearer its object keeps to how the human's moved, the higher
its <b>reward</b>. How the arm does that is left to it.</li>
</ol>
<p>No action of the human was recorded, and nobody told the robot what success is.</p>
""",
}

METHOD = """
<p>In the upper row a frame of the human video is translated, by a network called MUNIT, and another
one, Transporter, finds keypoints on it. In the lower one are the robot's own camera and the
keypoints found there, which give the policy's action. Compared with the video's they give the
reward, from which the policy learns by SAC, soft actor-critic. Eq. are the paper's equations.</p>
"""

VIDEOS = {  # what each method learns from
    "lbw": "one video",
    "avid": "15 videos of a human",
    "classifier": "35 videos of itself",
    "tracks": "how an object moved",
}
SHOWN = {
    "lbw": "What the human showed, and what the robot saw in it",
    "avid": "What the human showed, and what the classifier was shown",
    "classifier": "What the classifier was shown",
    "tracks": "What the human showed, and the object in it",
}

CLIP = {
    "lbw": """
<p>This is your clip. A simulated human did its motion again in the task's scene; that film was
translated, and the robot imitates it. So it learns your motion, not your object. It practises up to
twice as long as with the kit's own video, because your way and your pauses are others. <a
href="prepare.html">What was found in the clip</a></p>
""",
    "tracks": """
<p>This is your clip. A simulated human did its motion again in the task's scene, and the robot
imitates how the object moved in that film. So it learns your motion, not your object. <a
href="prepare.html">What was found in the clip</a></p>
""",
}

DEMONSTRATION = {
    "lbw": """
<p>Above: the human video, from left to right. Below: the same moments as the translation network
repaints them, with the keypoints found there. Look for two things. The robot's arm should stand
where the human's does, and the object should still be there. A dot of one colour should stay on
the same part of the arm, or on the object, in every column; one or two may stay in empty air.</p>
""",
    "avid": """
<p>Above: the first human video, from left to right. Below: the same moments as CycleGAN repaints
them, and how likely the goal classifier takes each for an end (a logit: above 0 it says yes). Is
the object still there, and is the arm where it should be?</p>
""",
    "classifier": """
<p>The first video of the robot, from left to right, and how likely the goal classifier takes each
moment for an end (a logit: above 0 it says yes).</p>
""",
    "tracks": """
<p>The human video, from left to right. Yellow pixels are the points that were found to be the
object's. Each should stay where it is on the object.</p>
""",
}

EPISODE = {
    "lbw": """
<p>The first test episode beside the video, both from their first frame on and at half speed. The
dots are the keypoints it steers by: all it knows of the scene. It need not keep the human's pace:
a long video is sped up, and a fast one slowed down.</p>
""",
    "rival": """
<p>The first test episode at half speed, as the robot's camera sees it. It knows the last three of
these pictures, and nothing else of the scene.</p>
""",
    "tracks": """
<p>The first test episode at half speed, as the robot's camera sees it. It knows how far the object
has moved, and where the nearest of its arm is, seen from the object.</p>
""",
}

PATHS = """
<p>Dashed: where each keypoint went in the demonstration. Solid: where it goes in the robot's test
episode, from the white dot to the numbered one. A solid line that runs along the dashed one of
its colour is imitation. The robot keeps its own pace, so compare the shapes of the paths, and
where they end.</p>
"""

SCENE = """
<p>Drag to turn the scene, drag with the right button to shift it; after a click the wheel zooms.
<i>Open Controls</i> stops the film and steps through it.</p>
"""

LEARNING = {
    "lbw": """
<p>Each grey dot is one attempt of the robot while it was learning, with some chance in its
actions. Look for the blue line of the upper picture to climb towards 1. In the lower picture, a
return nearer to 0 follows the demonstration more closely. The literal reward is Eq. 8-10 as the
paper states them; the mended one adds what makes them learn. Success is only counted here; it is
no part of the reward.</p>
""",
    "rival": """
<p>Each grey dot is one attempt of the robot while it was learning, with some chance in its
actions. Look for the blue line of the upper picture to climb towards 1. If the lower one climbs and
the upper does not, the robot has found pictures that please the classifier and do not show the
task. Success is only counted here; it is no part of the reward.</p>
""",
    "tracks": """
<p>Each grey dot is one attempt of the robot while it was learning, with some chance in its
actions. Look for the blue line of the upper picture to climb towards 1. In the lower picture, a
return nearer to 0 moves the object more as the human did. Success is only counted here; it is no
part of the reward.</p>
""",
}

REWARD = {
    "lbw": """
<p>The two parts of what the robot earned at each step of the test episode: r1 for being where the
demonstration is, r2 for moving as the demonstration moves. In the sum r2 counts three times. Both
are at most 0, and 0 means exactly as in the demonstration. Look for r1 to stay near 0, or to come
back to it, until the end.</p>
""",
    "rival": """
<p>The goal classifier's logit of the robot's picture at each step of the test episode. The reward
is that, divided by the logit that earns a reward of 1, which the settings below name.</p>
""",
    "tracks": """
<p>The three parts of what the robot earned at each step of the test episode: r1 for an object that
is where the human's was, r2 for one that moves as it did, r3 for an arm that is at the object while
there is a way to go. In the sum r2 counts three times. All are at most 0.</p>
""",
}

PERCEPTION = """
<p>How well the keypoints tell where things are: R² of a straight-line fit from them to the true
pixel of the gripper's tip and of the object (1 is perfect), and in brackets the usual error in
pixels. <i>robot</i>: on robot frames. <i>translated</i>: on translated human frames.
<i>transfer</i>: the fit of the robot frames, used on translated ones. A dash: it did not
move.</p>
"""


SMOKE = "This was a smoke run: no stage ran long enough to learn. Its figures say nothing."
GOAL = "An episode is a success if {}."
LEARNT = "Learnt in this run: {}. The rest was trained before."
REPLAY = "A replay: nothing was learnt in this run. What it shows was trained before."
SET = '<p class="small">The numbers of the recipe are written as <code>--set</code> takes them.</p>'

# What the names in metrics.json mean.
WORDS = {
    "from_scratch": "perception trained in this run",
    "jitter": "starts are moved by up to (m)",
    "video": "fingerprint of the video",
    "set": "changed by --set",
    "fast": "smoke run",
    "without": "mend of the reward that is left out",
    "version": "version of the kit",
    "memory_mb": "memory (MB)",
    "human_frames": "frames of the human that perception learns from",
    "robot_frames": "frames of the robot that it learns from",
    "munit_iterations": "steps of the translation's training",
    "munit_width": "channels of the translation's first layer",
    "transporter_iterations": "steps of the keypoints' training",
    "K": "keypoints",
    "shift": "pixels by which the keypoints' training moves frames",
    "hue": "degrees by which it turns hues",
    "policy_steps": "steps that the robot practises",
    "updates": "updates of the policy at each of them",
    "entropy": "chance in its actions at first (entropy of each number)",
    "motion": "what moves counts more in the translation",
    "classifier_iterations": "steps of the goal classifier's training",
    "random_negatives": "random motion is shown to it as no goal",
    "clip": "its logit that earns a reward of 1",
    "pixel_updates": "updates of the policy at each step",
    "hold": "steps for which a random action is kept at first",
    "contact_px demonstration": "from tip to object while it moves, in the video (pixels)",
    "contact_px robot": "the same of the robot's expert",
    "keypoint_std": "how far each coordinate of a keypoint moves (standard deviation)",
}
