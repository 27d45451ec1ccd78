"""What all tests share."""

import pytest
import torch


@pytest.fixture(autouse=True)
def one_thread():
    """Two threads on a machine whose second core is busy wait for each other, and take ten times as
    long."""
    torch.set_num_threads(1)
