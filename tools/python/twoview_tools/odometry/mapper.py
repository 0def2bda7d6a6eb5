"""The keyframes of a run through COLMAP's mapper (pycolmap): SIFT, exhaustive matching, incremental
mapping with the camera held. Both systems' keyframe positions are compared with the truth, and what
each took."""

import os
import shutil
import time

import numpy as np

from . import errors, poses

SEED = 1


def keyframes_of(out):
    """{name of the image: centre} of the text model in out/colmap, of the longest segment."""
    found = {}
    with open(os.path.join(out, "colmap", "images.txt"), encoding="utf-8") as file:
        heads = [line for line in file.read().split("\n") if not line.startswith("#")][::2]
    for line in filter(None, heads):
        words = line.split(maxsplit=9)
        w, x, y, z, *t = map(float, words[1:8])
        found[words[9]] = -poses.rotations_of([[x, y, z, w]])[0].T @ np.array(t)
    return found


def _camera(out):
    """(model, width, height, parameters) of out/colmap/cameras.txt."""
    with open(os.path.join(out, "colmap", "cameras.txt"), encoding="utf-8") as file:
        words = [line for line in file if not line.startswith("#")][0].split()
    return words[1], int(words[2]), int(words[3]), [float(word) for word in words[4:]]


def reconstruct(source, out, folder):
    """Runs COLMAP over the keyframes' images. Returns ({name: centre} of the largest model, number
    of models, seconds of wall time, CPU seconds)."""
    import pycolmap
    shutil.rmtree(folder, ignore_errors=True)
    images = os.path.join(folder, "images")
    os.makedirs(images)
    names = {}  # COLMAP's flat name: ours
    for k, name in enumerate(sorted(keyframes_of(out))):
        flat = f"{k:05d}{os.path.splitext(name)[1]}"
        names[flat] = name
        os.symlink(os.path.abspath(os.path.join(source.path, name)), os.path.join(images, flat))
    database = os.path.join(folder, "database.db")
    model, _, _, parameters = _camera(out)
    pycolmap.set_random_seed(SEED)
    begin, begin_cpu = time.monotonic(), time.process_time()
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = model
    reader.camera_params = ",".join(repr(value) for value in parameters)
    extraction = pycolmap.FeatureExtractionOptions()
    extraction.use_gpu = False
    pycolmap.extract_features(database, images, camera_mode=pycolmap.CameraMode.SINGLE,
                              reader_options=reader, extraction_options=extraction)
    matching = pycolmap.FeatureMatchingOptions()
    matching.use_gpu = False
    pycolmap.match_exhaustive(database, matching_options=matching)
    options = pycolmap.IncrementalPipelineOptions()
    options.ba_refine_focal_length = False
    options.ba_refine_principal_point = False
    options.ba_refine_extra_params = False
    models = pycolmap.incremental_mapping(database, images, os.path.join(folder, "models"), options)
    wall, cpu = time.monotonic() - begin, time.process_time() - begin_cpu
    if not models:
        return {}, 0, wall, cpu
    best = max(models.values(), key=lambda model: model.num_reg_images())
    centres = {names[image.name]: np.array(image.projection_center())
               for image in best.images.values() if image.has_pose}
    return centres, len(models), wall, cpu


def _ate(centres, true):
    """(rms of the positions after the similarity, how many) over images with a truth."""
    shared = sorted(set(centres) & set(true))
    if len(shared) < 3:
        return None, len(shared)
    path = [poses.Trajectory(np.arange(len(shared)), np.array([of[name] for name in shared]),
                             np.tile(np.eye(3), (len(shared), 1, 1))) for of in (centres, true)]
    return errors.rms(errors.position_errors(*path)[0]), len(shared)


def compare(source, out, folder):
    """The figures of both systems: over the keyframes that both placed."""
    truth = source.truth()
    times = dict(zip(source.names, source.times))
    true = {}
    for name, at in times.items():
        k = int(np.abs(truth.times - at).argmin())
        if abs(truth.times[k] - at) <= 0.01:
            true[name] = truth.positions[k]
    ours = keyframes_of(out)
    theirs, num_models, wall, cpu = reconstruct(source, out, folder)
    both = set(ours) & set(theirs)
    common = [{name: of[name] for name in both} for of in (ours, theirs)]
    return {"num_keyframes": len(ours), "num_placed": len(theirs), "num_models": num_models,
            "num_compared": _ate(common[0], true)[1], "ate": _ate(common[0], true)[0],
            "colmap_ate": _ate(common[1], true)[0], "colmap_wall_s": wall, "colmap_cpu_s": cpu}


def sentence(label, found, cpu_s, num_frames):
    """(None, the line): a figure that is reported, without a limit."""
    def metres(value):
        return "none" if value is None else f"{value:.4f} m"
    return None, (f"{label}: beside COLMAP, ATE of {found['num_compared']} common keyframes: ours "
                  f"{metres(found['ate'])}, COLMAP's mapper {metres(found['colmap_ate'])} "
                  f"({found['num_placed']} of {found['num_keyframes']} placed, "
                  f"{found['num_models']} models); CPU: ours {cpu_s:.1f} s for all {num_frames} "
                  f"frames, COLMAP {found['colmap_cpu_s']:.0f} s for the keyframes")
