"""The experts' recordings as a Minari dataset, for those who learn from demonstrations.

Each recording is played again, so that frames and rewards are the environment's own.
"""

from __future__ import annotations

import warnings

import tasks
from lbw_minimal.training import InputError, counted
from tasks.commands import Parser
from tasks.world import film, load_recordings


def parser() -> Parser:
    """The arguments of `export`."""
    p = Parser(
        "export", "Write the human's expert episodes as a Minari dataset, lbw/TASK/human-v0."
    )
    p.add_task()
    return p


def main(argv: list[str]) -> None:
    """Write the dataset where Minari keeps its own. Raises InputError for a mistake in the
    arguments, if a recording no longer does the task, or if the dataset is there already."""
    name = parser().read(argv).task
    source, dataset = tasks.VIDEOS / name / "experts.npz", f"lbw/{name}/human-v0"
    recordings = load_recordings(source)
    try:
        import h5py  # noqa: F401 (Minari writes its files with it)
        import minari
        from minari.data_collector import EpisodeBuffer
        from minari.storage import get_dataset_path
    except ImportError:
        raise InputError(
            "export: Minari is not installed; python -m pip install 'minari[hdf5]' brings it."
        ) from None
    if get_dataset_path(dataset).exists():
        raise InputError(
            f"{dataset}: Minari has this dataset already; minari delete {dataset} removes it."
        )
    env = tasks.bare(name, embodiment="human")
    episodes = []
    for recording in counted(recordings, len(recordings), "episodes"):
        seed, scatter, actions, *_ = recording
        frames, _, played = film(env, seed, actions, scatter)
        if not played.success[-1]:
            raise InputError(
                f"{source}: played again, seed {seed} fails; python -m tasks record {name} "
                f"films it anew."
            )
        episodes.append(
            EpisodeBuffer(
                seed=seed,
                observations=frames,
                actions=played.actions,
                rewards=played.success[1:].astype(float),  # what `step` gives
                terminations=[False] * len(actions),
                truncations=[False] * (len(actions) - 1) + [True],  # the expert has finished
                infos={"is_success": played.success, "state": played.states, "time": played.times},
            )
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it wants an author's e-mail address and a link
        minari.create_dataset_from_buffers(
            dataset,
            episodes,
            env=env,
            eval_env=tasks.id_of(name),  # the robot, which is to learn it
            algorithm_name="scripted expert",
            description=f"{tasks.sentence(name)} Frames of the human arm; infos hold the "
            "simulator's state (tip, object, target in m) and the time in s.",
            jpeg_encoding=False,  # frames as they are
        )
    env.close()
    print(f"{name}: {len(episodes)} episodes; minari.load_dataset({dataset!r}) reads them")
