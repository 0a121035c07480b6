"""csm.operators."""
