"""Long checks of what must hold whatever happens to processes, files and disks; `make soak` runs them, CI does not."""
