"""The stars of the notebooks, a file each."""
