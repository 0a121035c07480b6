"""Sets of shapes: where they are, what is known of their correspondence, the store, and the data modules."""
