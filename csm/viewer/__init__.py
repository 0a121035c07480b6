"""Pictures of meshes and maps: software rendering, figures and pages that need no display and no network."""
