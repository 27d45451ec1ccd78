"""Which corners of a picture are the object's, by hand on ways of twenty frames."""

import numpy as np
import pytest

from lbw_minimal.clips.corners import objects_own


@pytest.mark.parametrize(("share", "own"), [(0.24, False), (0.26, True), (1.0, True)])
def test_a_corner_that_goes_less_than_a_quarter_of_the_objects_way_is_not_its(share, own):
    """For 15 frames both rest, and then the object goes by 40 pixels."""
    way = np.concatenate([np.zeros(15), np.linspace(8, 40, 5)])
    path = np.stack([50 + way, np.full(20, 30.0)], 1)
    corner = np.stack([53 + share * way, np.full(20, 31.0)], 1)
    is_own, middle = objects_own(corner[:, None], path, 1.0)
    assert is_own.tolist() == [own]
    if share == 1:
        np.testing.assert_allclose(middle, [[-3, -1]])
