"""A person's own clip: read, looked at, and laid into a task's scene for the simulated human."""
