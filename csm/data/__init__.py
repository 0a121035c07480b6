"""csm.data."""
