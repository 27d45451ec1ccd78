#!/usr/bin/env bash
# Gradescope runs this once, as root, when it builds the image: Python, and what the kit requires.
set -e
root=${AUTOGRADER:-/autograder}
promised='import ensurepip, sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))'

fitting() {
    for python in python3.11 python3.12 python3.13 python3; do
        if "$python" -c "$promised" 2> /dev/null; then
            echo "$python"
            return
        fi
    done
    return 1
}

apt-get update
apt-get install -y bubblewrap
# Ubuntu 22.04 has Python 3.11 beside its own; 24.04's own, 3.12, lacks venv alone.
python=$(fitting) || {
    apt-get install -y python3.11 python3.11-venv || apt-get install -y python3-venv
    python=$(fitting)
}

cd "$root/source"
"$python" -m venv "$root/venv"
# With PyTorch's CPU build, which its own index has.
"$root/venv/bin/python" -m pip install --no-cache-dir -r requirements.txt -c requirements-lock.txt \
    --extra-index-url https://download.pytorch.org/whl/cpu
