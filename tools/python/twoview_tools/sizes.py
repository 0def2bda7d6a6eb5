"""The sizes at which the tables measure images. This module imports nothing."""

MAX_NATIVE_SIDE = 1241  # pixels; by default a set of images with a longer side is resized
RESIZE_LONG_SIDE = 640  # pixels, the long side of an image after resizing
