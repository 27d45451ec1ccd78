"""What all tests share."""

import pytest
import torch


@pytest.fixture(autouse=True)
def one_thread():
    """Two threads wait for each other where the second core is busy, and take ten times as long."""
    torch.set_num_threads(1)
