"""Writes a set folder that is made of another one: links to its pictures, and pictures that are
made. fault.json says of what and how: {kind, source, intervals, elsewhere}."""

import json
import os
import shutil

import numpy as np

from .sets import write_frames


def read_grey(source, k):
    """The picture of frame k of a sets.SetFolder."""
    import cv2
    path = os.path.join(source.path, source.names[k])
    picture = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
    if picture is None:
        raise OSError(f"cannot read {path}")
    return picture


def with_noise(grey, sigma, random):
    return np.clip(grey + random.normal(0, sigma, np.shape(grey)), 0, 255).astype(np.uint8)


class SetWriter:
    """The new folder. `links`: files of the source that it has, too."""

    def __init__(self, source, folder, links=()):
        self.source, self.folder = source, folder
        shutil.rmtree(folder, ignore_errors=True)
        os.makedirs(os.path.join(folder, "images"))
        self.times, self.names = [], []
        for name in links:
            if source.file(name):
                os.symlink(os.path.abspath(source.file(name)), os.path.join(folder, name))

    def keep(self, k, time=None):
        """Frame k of the source, unharmed, at its time or another one."""
        path = os.path.join(self.source.path, self.source.names[k])
        name = f"images/{k:05d}{os.path.splitext(path)[1]}"
        os.symlink(os.path.abspath(path), os.path.join(self.folder, name))
        self._add(k, name, time)

    def make(self, k, picture, ending=".jpg"):
        """A picture in place of frame k, compressed as its file's ending says."""
        import cv2
        name = f"images/{k:05d}{ending}"
        how = ([cv2.IMWRITE_PNG_COMPRESSION, 1] if ending == ".png"
               else [cv2.IMWRITE_JPEG_QUALITY, 92])
        if not cv2.imwrite(os.path.join(self.folder, name), picture, how):
            raise OSError(f"cannot write {self.folder}/{name}")
        self._add(k, name)

    def _add(self, k, name, time=None):
        self.times.append(self.source.times[k] if time is None else time)
        self.names.append(name)

    def finish(self, kind, intervals=(), elsewhere=()):
        """Returns the folder."""
        write_frames(self.folder, self.times, self.names)
        with open(os.path.join(self.folder, "fault.json"), "w", encoding="utf-8") as file:
            json.dump({"kind": kind, "source": self.source.name, "intervals": list(intervals),
                       "elsewhere": list(elsewhere)}, file, indent=1)
        return self.folder
