"""Maps from descriptors, their errors, and the protocol that makes the errors comparable."""
