"""Basic types of the project, used by all other packages. No physics, no methods."""
