"""What all tests share. The process that deals them out to others reads this, too, and it imports
nothing that takes long."""

import functools
import gc
import sys
from pathlib import Path

import pytest

# jsonschema looks for it and builds its grammar in 1.3 s, for IRIs, which nothing here has.
sys.modules["rfc3987_syntax"] = None

# Files of more than 8 s of processor time, the longest first: two processes so end together.
LONG = (
    "test_cluster.py", "test_grading.py", "test_stars.py", "test_strangers.py",
    "test_exercises.py", "test_tasks.py", "test_detector.py", "test_cli.py", "test_house.py",
    "test_answers.py", "test_arguments.py", "test_transporter.py", "test_prepare.py",
    "test_systems.py", "test_limits.py", "test_follow.py", "test_rivals.py",
    "test_gradescope.py", "test_recordings.py", "test_grading_sandbox.py", "test_munit.py",
    "test_sac.py", "test_pages.py", "test_cyclegan.py", "test_clip.py", "test_stage.py",
    "test_video.py", "test_viewer.py",
)  # fmt: skip


def pytest_addoption(parser):
    parser.addoption(
        "--write-golden", action="store_true", help="write the figures of tests/golden/"
    )


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Thousands of tests are no garbage: looking for some among them takes a third of the time of
    their collection, and half of the time of all later searches."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items):
    ranks = {name: rank for rank, name in enumerate(LONG)}
    items.sort(key=lambda item: ranks.get(item.path.name, len(LONG)))


# The archive for students has no solved notebooks, and these tests are of them.
if not any((Path(__file__).parent.parent / "solutions").glob("*.ipynb")):
    collect_ignore = [
        "test_answers.py", "test_archive.py", "test_arguments.py", "test_cluster.py",
        "test_for_class.py", "test_grading.py", "test_grading_files.py", "test_lessons.py",
        "test_nbgrader.py", "test_notebooks.py", "test_pages.py", "test_systems.py",
    ]  # fmt: skip


@pytest.fixture(autouse=True)
def one_thread():
    """Two threads wait for each other where the second core is busy, and take ten times as long."""
    import cv2
    import torch

    cv2.setNumThreads(1)
    torch.set_num_threads(1)


@pytest.fixture(scope="session", autouse=True)
def memory_is_kept():
    """As a judge keeps it: a world of PyBullet takes a sixth of the time to start."""
    from tests.grade.judge import settle

    if sys.platform == "linux":  # glibc's own
        settle()


@pytest.fixture
def golden(request):
    """golden({name: figures}, rtol, atol): are they those that are kept? See `tests/golden.py`."""
    from tests.golden import check

    def golden(figures, rtol=1e-3, atol=1e-6):
        check(request.node.nodeid, figures, rtol, atol, request.config.getoption("--write-golden"))

    return golden


@pytest.fixture
def one_trial(monkeypatch):
    """A training of some steps has one actor worth a name: an episode is enough to choose it."""
    monkeypatch.setattr("lbw_minimal.sac.TRIALS", 1)


@pytest.fixture(scope="session")
def workers_wait():
    """Graders take a worker that waits, and let theirs wait, see `tests/kept.py`."""
    import tests.grade.__main__ as grading
    from tests import kept

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(grading, "Sandbox", kept.Kept)
        yield
    kept.end()


@pytest.fixture(scope="session", autouse=True)
def robots_filmed_once():
    """The film that shows a robot's pace takes seconds, and hangs on its arguments alone."""
    import tasks
    from lbw_minimal.imitate import PACE

    film, kept = tasks.pace_film, {}

    def pace_film(name, seed=0, frames=None):
        key = name, seed, frames or PACE
        if key not in kept:
            kept[key] = film(name, seed, frames)
        return kept[key].copy()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tasks, "pace_film", pace_film)
        yield


@pytest.fixture(scope="session", autouse=True)
def shipped_videos_read_once():
    """Each run reads its task's, in half a second; what reading them gives, test_video.py asks."""
    import tasks
    from tasks.commands import job

    read, once = job.read_video, functools.cache(job.read_video)

    def read_video(path, whole=False):
        shipped = tasks.VIDEOS in path.parents
        return once(path, whole).copy() if shipped else read(path, whole)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(job, "read_video", read_video)
        yield


@pytest.fixture(scope="module")
def make():
    """Environments of the simulator's truth, by task and arm, one of a kind."""
    import tasks

    made = {}

    def make(name, arm="robot"):
        if (name, arm) not in made:
            made[name, arm] = tasks.bare(name, embodiment=arm, observation="state")
        return made[name, arm]

    yield make
    for env in made.values():
        env.close()
