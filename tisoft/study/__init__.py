"""Studies that only use the simulator."""
