"""Normals of meshes that are hardly meshes."""

import warnings

import numpy as np

from tasks.world.meshes import normals


def test_a_mesh_that_is_a_point_has_no_directions_and_no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert (normals(np.ones((2, 3, 3))) == 0).all()
