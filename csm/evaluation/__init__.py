"""csm.evaluation."""
