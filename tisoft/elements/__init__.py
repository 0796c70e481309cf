"""Elements, one file each: rest numbers, forces, energy, product, frequency bound."""
