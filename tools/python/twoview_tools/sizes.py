"""The sizes at which the tables measure images, and those of photographs. This module imports
nothing."""

MAX_NATIVE_SIDE = 1241  # pixels; by default a set of images with a longer side is resized
RESIZE_LONG_SIDE = 640  # pixels, the long side of an image after resizing
# kLargeSide and kUsualSide of tools/twoview/pair/options.h: `reconstruct` brings images with a
# longer side than the first to the second.
LARGE_SIDE, USUAL_SIDE = 2048, 1600
