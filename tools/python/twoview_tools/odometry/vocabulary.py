"""Makes the vocabulary that ORB-SLAM3 needs, from images: a tree of binary words by hierarchical
k-majority over ORB descriptors, in DBoW2's text form (D. Galvez-Lopez, J. D. Tardos, "Bags of
binary words for fast place recognition in image sequences", TRO 28(5), 2012).

It stands in for the official one (145 MB, one million words), which is not fetched: relocation and
loops of ORB-SLAM3 may be weaker with it.

usage: python vocabulary.py OUT IMAGE...   (needs numpy and cv2)"""

import os
import sys

import numpy as np

BRANCHES, LEVELS = 10, 5
MIN_LEAF = 4  # descriptors below which a node is not divided
ROUNDS = 6  # iterations of the clustering by k-majority
SEED = 1
_BITS = np.array([bin(value).count("1") for value in range(256)], np.uint8)


def describe(paths, most=1000):
    """([descriptors (n x 32)] of each image) by OpenCV's ORB."""
    import cv2
    orb = cv2.ORB_create(nfeatures=most)
    found = []
    for path in paths:
        picture = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
        _, descriptors = orb.detectAndCompute(picture, None) if picture is not None else (0, None)
        if descriptors is not None:
            found.append(descriptors)
    return found


def _distances(descriptors, centres):
    out = np.empty((len(descriptors), len(centres)), np.int32)
    for k, centre in enumerate(centres):
        out[:, k] = _BITS[descriptors ^ centre].sum(1)
    return out


def _clusters(descriptors, random):
    """The centres (at most BRANCHES) and the label of each descriptor."""
    unique = np.unique(descriptors, axis=0)
    if len(unique) <= BRANCHES:
        return unique, _distances(descriptors, unique).argmin(1)
    # Seeds far from one another, as k-means++ takes them.
    centres = [descriptors[random.integers(len(descriptors))]]
    nearest = _distances(descriptors, centres)[:, 0].astype(float)
    while len(centres) < BRANCHES:
        if not nearest.sum():
            break
        weights = nearest ** 2
        centres.append(descriptors[random.choice(len(descriptors), p=weights / weights.sum())])
        nearest = np.minimum(nearest, _distances(descriptors, centres[-1:])[:, 0])
    centres = np.array(centres)
    labels = None
    for _ in range(ROUNDS):
        new = _distances(descriptors, centres).argmin(1)
        if labels is not None and (new == labels).all():
            break
        labels = new
        for k in range(len(centres)):
            own = descriptors[labels == k]
            if len(own):
                centres[k] = np.packbits(np.unpackbits(own, axis=1).mean(0) > 0.5)
    return centres, _distances(descriptors, centres).argmin(1)


def grow(images, seed=SEED):
    """The nodes of the tree, in an order in which parents come first: (parent, is_leaf, descriptor,
    weight). Numbers begin at 1; the root is 0. Weights are log(images / images with the word)."""
    random = np.random.default_rng(seed)
    everything = np.concatenate(images)
    of_image = np.repeat(np.arange(len(images)), [len(image) for image in images])
    nodes, waiting = [], [(0, np.arange(len(everything)), 0)]
    while waiting:
        parent, members, level = waiting.pop(0)
        centres, labels = _clusters(everything[members], random)
        for k, centre in enumerate(centres):
            own = members[labels == k]
            if not len(own):
                continue
            is_leaf = level + 1 == LEVELS or len(own) < MIN_LEAF * 2
            weight = np.log(len(images) / len(np.unique(of_image[own]))) if is_leaf else 0.0
            nodes.append((parent, is_leaf, centre, weight))
            if not is_leaf:
                waiting.append((len(nodes), own, level + 1))
    return nodes


def write(path, nodes):
    """Writes DBoW2's text form: TF-IDF weights and the L1 score, the vocabulary's own defaults."""
    lines = [f"{BRANCHES} {LEVELS}  0 0"]
    lines += [f"{parent} {int(is_leaf)} " + " ".join(map(str, descriptor)) + f" {weight:.6g}"
              for parent, is_leaf, descriptor, weight in nodes]
    unfinished = path + ".unfinished"
    with open(unfinished, "w", encoding="ascii") as file:
        file.write("\n".join(lines))  # no last line end: DBoW2 would read one more, empty node
    os.replace(unfinished, path)


def main(arguments):
    images = describe(arguments[1:])
    nodes = grow(images)
    write(arguments[0], nodes)
    print(f"{sum(node[1] for node in nodes)} words, {len(nodes)} nodes, of {len(images)} images")


if __name__ == "__main__":
    main(sys.argv[1:])
