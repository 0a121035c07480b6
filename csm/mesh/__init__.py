"""csm.mesh."""
