"""A look at a scene before it runs."""
