"""One page that shows all tasks: scene, demonstration, what the robot saw in it, and a rollout;
and, below them, what becomes of a clip of one's own.

In: the human videos and the trained weights that come with the kit. Out: `index.html` with the
pictures in it, and beside it a scene for every task and arm that turns with the mouse, each a file
of its own, and every task's film as a WebP and that clip's pictures as a PNG, for slides and
READMEs.
"""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import cast

import gymnasium as gym
import numpy as np

import tasks
from lbw_minimal import sac, video
from lbw_minimal.films import Film
from lbw_minimal.imitate import watched
from lbw_minimal.pictures import data_uri, draw_keypoints
from lbw_minimal.report import demonstration
from lbw_minimal.report_texts import CSS, HTML
from lbw_minimal.training import write_atomic
from tasks.commands import Parser, make_folder, own_arm
from tasks.commands.links import links
from tasks.commands.viewer import perform
from tasks.world import TaskEnv
from tasks.world.scene import FPS
from tasks.world.viewer import mirror

SEED = 0  # of the rollout that is shown: no start jitter, as in the video
PAIR = """
.pair { display: grid; grid-template-columns: repeat(2, 1fr); gap: .5rem }
.pair figure { margin: 0 }
.pair iframe, .pair img { width: 100%; height: 17rem; object-fit: cover }
@media (max-width: 40rem) { .pair { grid-template-columns: 1fr } }
@media print { .pair { grid-template-columns: repeat(2, 1fr) } .pair img { height: 7rem }
               .film { display: none } section { break-inside: avoid }
               h2 { font-size: 1.05rem; margin-top: .5rem; padding-top: .4rem }
               .strip { margin: .4rem 0 } }
"""
HEAD = """
<h1>The five tasks</h1>
<p>Above in each row of pictures: frames of the one human video the robot learns from. Below: the
same frames translated into the robot's world, with the keypoints found on them. Then, at half
speed, the whole video beside what the robot learnt from it, and both arms in scenes that turn with
the mouse.</p>
"""


def parser() -> Parser:
    """The arguments of `gallery`."""
    p = Parser("gallery", "One page with every task's scene, demonstration and rollout.")
    p.add_argument(
        "--out", type=Path, default=Path("runs/gallery"), metavar="DIR", help="its folder"
    )
    return p


def main(argv: list[str]) -> None:
    """Write the gallery. Raises InputError for a mistake in the arguments or missing weights."""
    print(f"gallery: {write(parser().read(argv).out)}")


def write(out: Path) -> Path:
    """Write the gallery into the folder `out` and return its page."""
    make_folder(out)
    page = [HEAD]
    for name in tasks.TASKS:
        if not (tasks.WEIGHTS / name).is_dir():  # a new task, which nobody has trained yet
            print(f"{name}: left out, for it has no weights in {tasks.WEIGHTS / name}")
            continue
        page.append(section(name, out))
        print(f"{name}: done", flush=True)
    clip = own_arm.prepared()
    page.append(own_arm.section(clip))
    if clip.done:
        write_atomic(out / "lookalike.png", own_arm.strip(clip))
    title, path = "LbW minimal: the five tasks", out / "index.html"
    body, css = "".join(page), CSS + PAIR
    write_atomic(path, HTML.format(title=title, css=css, links=links(path), body=body))
    return path


def section(name: str, out: Path) -> str:
    """One task's part of the page; its scenes go to files beside it."""
    demo, _ = video.read(tasks.VIDEOS / name / "expert_01.mp4")
    perception, robot = tasks.trained_perception(name), tasks.pace_film(name)
    agent = sac.load(tasks.WEIGHTS / name / "policy.safetensors")
    env, _ = watched(gym.make(tasks.id_of(name)), perception, robot)
    frames, z, won, robots = rollout(env, agent, out / f"{name}-robot.html")
    human = tasks.bare(name, embodiment="human")
    shows = perform(human, out / f"{name}-human.html", "The human, who shows it").picture()
    human.close()

    films = Film(
        {"the human": demo,
         "its translation": draw_keypoints(perception.translated, perception.z_E, 3),
         "the robot, which " + ("succeeds" if won else "fails"): draw_keypoints(frames, z, 3)},
        FPS / 2,
    )  # fmt: skip
    write_atomic(out / f"{name}.webp", films.webp())
    pair = [
        (scene(name, "human", shows), "the human, who shows it"),
        (scene(name, "robot", robots), "the robot, as it learnt it"),
    ]
    cells = "".join(
        f"<figure>{x}<figcaption>{caption}</figcaption></figure>" for x, caption in pair
    )
    columns = demonstration(demo, perception.translated, perception.z_E, FPS)
    title = escape(tasks.sentence(name))
    return (
        f'<section><h2>{title}</h2>{columns}{films.html()}<div class="pair">{cells}</div></section>'
    )


def scene(name: str, arm: str, png: bytes) -> str:
    """The scene of a task and arm, loaded when it comes into view; on paper a PNG stands in."""
    still = (
        f'<img class="still" alt="{name}, {arm}, at the end" src="{data_uri("image/png", png)}">'
    )
    return f'<iframe loading="lazy" title="{name}, {arm}" src="{name}-{arm}.html"></iframe>{still}'


def rollout(
    env: gym.Env, agent: sac.Policy, path: Path
) -> tuple[np.ndarray, np.ndarray, bool, bytes]:
    """Frames, keypoints and success of an episode of the policy, and its end as a PNG; its scene
    goes to a file."""
    obs, _ = env.reset(seed=SEED)
    base, K = cast(TaskEnv, env.unwrapped), env.get_wrapper_attr("keypoint_reward").z_E.shape[1]
    frames, z, won, over, scene = [], [], False, False, mirror(base)
    scene.snap()
    while not over:
        obs, _, _, over, info = env.step(agent.act(obs, deterministic=True))
        frames.append(base.world.render())
        z.append(obs[: 2 * K].reshape(K, 2))
        won |= info["is_success"]
        scene.snap()
    scene.save(path, title="The robot, as it learnt")
    return np.stack(frames), np.stack(z), won, scene.picture()
