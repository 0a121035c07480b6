"""csm.descriptors."""
