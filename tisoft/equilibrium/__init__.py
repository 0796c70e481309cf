"""Static equilibrium and natural modes, in f64, a body at a time."""
