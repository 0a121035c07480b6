"""Triangle meshes: the type, files, correspondences and findings."""
