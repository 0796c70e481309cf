"""State, time stepping, stable steps, statics and modes."""
