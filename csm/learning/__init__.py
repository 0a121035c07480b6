"""csm.learning."""
