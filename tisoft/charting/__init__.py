"""Error against cost of a scene's variants, and the least of them that is good enough."""
