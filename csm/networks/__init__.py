"""csm.networks."""
