#!/bin/bash
# Gives twoview's features, matches and poses to COLMAP's mapper; COLMAP's feature_extractor,
# matcher and verification are not run.
# usage: 12_colmap.sh IMAGE_DIR CAMERA.yaml OUT_DIR     (twoview and Debian's colmap in the PATH)
set -euo pipefail
images=$1 camera=$2 out=$3
mkdir -p "$out/model"
twoview colmap export --database "$out/database.db" --images "$images" --camera "$camera" \
  --exhaustive --schema 3.8
colmap mapper --database_path "$out/database.db" --image_path "$images" --output_path "$out/model"
