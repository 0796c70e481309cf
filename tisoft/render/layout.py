"""Where things stand in the few arrays that all kernels of a picture share.

Arrays hold rows rather than structs, because kernels take an array at a fortieth of the price of
twenty numbers, and compile once for every size of it.  Lengths are in distances from the eye to the
target, about the target.
"""

# `stage`: rows of 4 numbers, what a picture knows of view, lamp and ground.  An affine map is a
# row a: a·(q, 1).  A row of the picture is a: a·(x, y, 1) at the place (x, y) in pixels.
(
    EYE,
    CORNER,  # the ray through (x, y) is corner + x across + y down, one unit long along forward
    ACROSS,
    DOWN,
    TO_X,  # affine maps to (x w, y w, w), w the depth
    TO_Y,
    TO_W,
    LAMP,  # direction towards it
    LAMP_X,  # affine maps to its map: texels, texels, height towards it
    LAMP_Y,
    LAMP_Z,
    PLANE,  # the ground's height in that map: a·(x, y, 1)
    GROUND,  # normal and level of the ground: normal·q = level
    GROUND_X,  # affine maps to the map seen from below: texels, texels, minus height
    GROUND_Y,
    GROUND_Z,
    FLOOR,  # of the picture: 1/depth of the ground, not positive where it is not seen
    ON_LAMP_X,  # of the picture: places of the ground on both maps, times that 1/depth
    ON_LAMP_Y,
    ON_GROUND_X,
    ON_GROUND_Y,
    TILES_X,  # affine maps to the ground's tiles
    TILES_Y,
    SIZES,  # width, height, samples a pixel, columns of tiles
    LAMP_SIZE,  # texels along a map and the side of one; the row LAMP_SIZE + its table
    GROUND_SIZE,
) = range(26)
PLACES = 26  # of the samples in a pixel, from 0 to 1
MOST_SAMPLES = 64
DISC = PLACES + MOST_SAMPLES  # points of the unit disc and their radii, for shadows on bodies
SEARCH, TAPS = 12, 24
ITEMS = DISC + SEARCH + TAPS  # of every item: wireframe, shine, radius, light it lets through

# `vertices[row, i]`: vectors of vertices of surfaces, then of the ends of capsules.
PLACE, SCREEN, NORMAL, COLOR = range(4)  # SCREEN: x, y in pixels and 1/depth

# `tables[row, i]`: maps and pyramids of maps, finest level first.
(
    LAMP_MAP,  # largest height towards the lamp
    GROUND_MAP,  # largest minus height above the ground
    PART,  # share of a texel of the lamp's map that is covered
    RADIUS,  # of the penumbra that what covers it throws on the ground, in texels
    MASK,  # the part that this level blurs
    SHADOW,  # share of the lamp hidden from the ground
    DIM,  # share of the sky hidden from the ground
    HOLLOWS,  # pairs: covered share and mean height of cells of the lamp's map, coarse and blurred
    CURVE,  # sRGB bytes of linear light, see `shade.encode`
    TABLES,
) = range(10)
CELLS = 64  # along the map of hollows
CURVE_LENGTH = 4096

TILE = 32  # pixels along a tile
NEAR = 1e-3  # nearest depth drawn, in distances from the eye to the target
EMPTY = -1e9  # of a texel above which there is nothing
