"""COLMAP's own reconstruction of a list of images, which is the reference if there is no ground
truth. It runs in a worker."""

import os
import tempfile

import numpy as np

from ..accuracy import datasets, estimators
from . import colmap_program
from .masked import used_pixels, write_masks


def reconstruct(task):
    """Returns [{image name: {"R", "t"}}] with cam_from_world, one dict for each model, the largest
    first.

    task: "images" {name: {"path", "K", "distortion"}}, "resize", "pairs" [[name0, name1]], "seed",
    "threads". Intrinsics stay as given.
    """
    import cv2
    pycolmap = estimators.pycolmap_module()
    with tempfile.TemporaryDirectory() as folder:
        database, images = os.path.join(folder, "database.db"), os.path.join(folder, "images")
        files = {name: f"{i:06d}.png" for i, name in enumerate(sorted(task["images"]))}
        by_camera, used = {}, {}
        for name, image in task["images"].items():
            gray, scale_x, scale_y = datasets.resized_luma(image["path"], task["resize"])
            os.makedirs(images, exist_ok=True)
            cv2.imwrite(os.path.join(images, files[name]), gray)
            used[files[name]] = used_pixels(image["mask"], gray.shape)
            K = datasets.scale_K(np.array(image["K"]), scale_x, scale_y)
            size = gray.shape[::-1]
            camera = (*colmap_program.camera_arguments(size, K, image["distortion"]), size)
            by_camera.setdefault(camera, []).append(files[name])
        masks = write_masks(os.path.join(folder, "masks"), used)
        for (model, parameters, _), names in by_camera.items():
            _extract(pycolmap, database, images, masks, names, model, parameters, task["threads"])
        _match(pycolmap, database, folder, task, files)
        return _map(pycolmap, database, images, folder, task, files)


def _extract(pycolmap, database, images, masks, names, model, parameters, threads):
    reader = pycolmap.ImageReaderOptions()
    if masks:
        reader.mask_path = masks
    reader.camera_model, reader.camera_params = model, parameters
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads, options.use_gpu = threads, False
    pycolmap.extract_features(database, images, names, pycolmap.CameraMode.SINGLE, reader, options,
                              pycolmap.Device.cpu)


def _match(pycolmap, database, folder, task, files):
    listed = os.path.join(folder, "pairs.txt")
    with open(listed, "w", encoding="utf-8") as f:
        f.writelines(f"{files[a]} {files[b]}\n" for a, b in task["pairs"])
    pairing = pycolmap.ImportedPairingOptions()
    pairing.match_list_path = listed
    options = pycolmap.FeatureMatchingOptions()
    options.num_threads, options.use_gpu = task["threads"], False
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = task["seed"]
    pycolmap.match_image_pairs(database, options, pairing, verification, pycolmap.Device.cpu)


def _map(pycolmap, database, images, folder, task, files):
    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads, options.random_seed = task["threads"], task["seed"]
    options.min_model_size, options.extract_colors = 3, False
    options.ba_refine_focal_length = options.ba_refine_principal_point = False
    options.ba_refine_extra_params = False
    options.mapper.abs_pose_refine_focal_length = False
    options.mapper.abs_pose_refine_extra_params = False
    models = os.path.join(folder, "models")
    os.mkdir(models)
    found = pycolmap.incremental_mapping(database, images, models, options)
    names = {file: name for name, file in files.items()}
    result = []
    for model in found.values():
        poses = {}
        for image in model.images.values():
            if image.has_pose:
                pose = image.cam_from_world()
                poses[names[image.name]] = {"R": pose.rotation.matrix().tolist(),
                                            "t": np.ravel(pose.translation).tolist()}
        result.append(poses)
    return sorted(result, key=len, reverse=True)
