"""Whether the kit is installed in the Python that runs it.

`tasks` asks this first, so that `python -m tasks` outside the environment ends in one sentence.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec

NEEDS = (  # the kit's block of requirements.txt, as Python calls its packages
    "torch", "pybullet", "gymnasium", "cv2", "av", "meshcat", "numpy", "PIL", "safetensors",
    "umsgpack", "matplotlib", "tqdm", "mistune",
)  # fmt: skip


def check(how: str) -> None:
    """End `python -m` with a sentence if a package is missing; how: the program's first argument.

    Python says "-m" there while it looks for the module. A notebook or a test that imports the kit
    gets Python's own error.
    """
    missing = [name for name in NEEDS if find_spec(name) is None]
    if how == "-m" and missing:
        sys.exit(
            f"error: {sys.executable} has no {missing[0]}; run .venv/bin/python -m tasks instead, "
            'or install the kit first, see "On your system" in README.md.'
        )


check(sys.argv[0])
