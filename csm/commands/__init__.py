"""csm.commands."""
