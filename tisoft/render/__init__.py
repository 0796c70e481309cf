"""Off-screen pictures: camera, rasteriser, colours, video."""
