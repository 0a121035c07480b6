"""csm.viewer."""
