"""LbW minimal: the paper's method.

It knows images, keypoints and actions, and nothing of the simulator.
"""

__version__ = "0.2.0"
