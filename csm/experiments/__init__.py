"""Training, testing and matrices of both, usable in a script without Hydra."""
